"""A host that is killed, and one that comes and goes; how soon is the commands' business."""

from __future__ import annotations

import errno
from collections import Counter

import pytest
from can.interfaces import BACKENDS

from pam_check.endurance.kill_trials import kill_once
from pam_check.endurance.lifecycle_cycles_node import WARM, WAYS, Cycles, draw_losses, run_cycles
from pam_check.endurance.process_use import Use
from pam_check.endurance.unpluggable_bus import INTERFACE, PLUG, UnpluggableBus
from pam_demo.chain import multicast_bus
from pam_driver.can_bus.bus import BusState, SendOutcome, open_bus
from pam_driver.can_bus.bus_opening import BusError
from pam_model.errors import PamError
from support.rigs import ELBOW

pytestmark = pytest.mark.system


@pytest.mark.parametrize("one_process", [False, True])
def test_boards_vent_by_themselves_when_their_host_is_killed(rig, one_process):
    vented, _ = kill_once(rig, 0.05, one_process=one_process)
    assert vented > 0.0


@pytest.mark.long(
    "test_node_end holds what one lifecycle leaves, test_driver_bus how a bus is lost"
)
def test_nothing_is_left_of_lifecycles_with_and_without_a_bus():
    done = run_cycles(ELBOW, 20, 8)
    assert done.lost == {
        f"{way}, {end}": 1 for way in WAYS for end in ("back", "cleaned up without")
    }
    assert [leak for leak in done.leaks if leak != "memory"] == []


def test_what_grows_is_named():
    use = Use(threads=17, handles=18, sockets=8, memory=10**8)
    grown = Use(threads=18, handles=19, sockets=9, memory=2 * 10**8)
    assert Cycles(use, use, Counter()).leaks == []
    assert Cycles(use, grown, Counter()).leaks == ["threads", "handles", "sockets", "memory"]


def test_the_bus_is_lost_at_random_but_in_each_way_equally_often():
    losses = draw_losses(1000, 200, 3)
    late = {number: loss for number, loss in losses.items() if number >= WARM}
    assert Counter(late.values()) == {(way, back): 25 for way in WAYS for back in (True, False)}
    assert losses == draw_losses(1000, 200, 3) != draw_losses(1000, 200, 4)
    assert set(draw_losses(1000, 0, 3)) == set()
    with pytest.raises(PamError, match="at most 5"):
        draw_losses(15, 6, 3)


def test_a_bus_that_is_unplugged_raises_what_the_system_would(monkeypatch, tmp_path):
    plug, bus = tmp_path / "plug", multicast_bus()
    monkeypatch.setenv(PLUG, str(plug))
    monkeypatch.setitem(BACKENDS, INTERFACE, (UnpluggableBus.__module__, "UnpluggableBus"))
    port = open_bus(INTERFACE, bus.channel, port=bus.port)
    try:
        assert port.send(0x80, b"\1", 1.0) is SendOutcome.SENT
        plug.write_text(str(errno.ENETDOWN))
        assert port.send(0x80, b"\1", 1.1) is SendOutcome.BUS_DOWN
        assert port.state is BusState.DOWN
        plug.unlink()
        assert port.send(0x80, b"\1", 1.2) is SendOutcome.SENT
        plug.write_text(str(errno.ENODEV))
        assert port.receive_all(1.3) == []
        with pytest.raises(BusError, match="No such device"):
            open_bus(INTERFACE, bus.channel, port=bus.port)
        port.receive_all(9.0)
        assert port.state is BusState.DOWN
        plug.unlink()
        port.receive_all(99.0)
        assert port.counts["reopened"] == 1
        assert port.send(0x80, b"\1", 99.1) is SendOutcome.SENT
    finally:
        port.close()
