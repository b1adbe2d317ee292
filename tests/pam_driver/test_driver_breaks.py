"""An exception that nobody foresaw while air moves: stopped, latched, told, exit code 70."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger

from pam_demo.chain import free_udp_port, private_domain
from pam_driver.boards.pam_board.codec import BoardCodec, BoardFault, BoardState
from pam_driver.driver import Driver
from pam_driver.safety.states import SafetyState
from pam_ros.driver_state import LATCHED
from pam_ros.unforeseen import BROKEN, described

from .node_bench import DriverProcess, RealTimeBoard, RosPeer
from .test_short_noes import Bench, People, Rig

# what raises, and the state in which the driver stops the joints
PLACES = {
    "DriverNode._publish_diagnostics": "fault_lowering",
    "DriverServices.on_clear_faults": "fault_lowering",
    "DriverTopics.publish": "fault_lowering",
    "DriverInputs._on_valve_commands": "fault_lowering",
    "Driver.cycle": "fault",
    "FaultJudge.judge": "fault",
    "DriverNode.on_deactivate": "fault",
}
PROGRAM = """
import pathlib, sys
from pam_driver import driver_node, driver, fault_judge
from pam_driver.driver_inputs import DriverInputs
from pam_driver.driver_node import DriverNode, DriverServices, DriverTopics
from pam_driver.driver import Driver
from pam_driver.fault_judge import FaultJudge
def breaks(owner, name):
    whole = getattr(owner, name)
    def call(*arguments, **named):
        if pathlib.Path({flag!r}).exists():
            raise LookupError("nobody\\nforesaw it")
        return whole(*arguments, **named)
    setattr(owner, name, call)
breaks({owner}, {name!r})
sys.exit(driver_node.main())
"""


@pytest.fixture
def peer() -> Iterator[RosPeer]:
    made = RosPeer(int(private_domain()["ROS_DOMAIN_ID"]))
    yield made
    made.close()


@pytest.mark.sampled(
    "one place for each way to stop; test_unforeseen_exceptions raises in every callback and loop",
    alike=lambda place: PLACES[place],
)
@pytest.mark.system
@pytest.mark.parametrize("place", PLACES)
def test_the_arm_is_stopped_the_fault_latched_and_the_exit_code_tells_it(
    place: str, codec: BoardCodec, peer: RosPeer, tmp_path: Path
) -> None:
    bus = {
        "interface": "udp_multicast",
        "channel": "239.74.163.9",
        "port": free_udp_port(),
    }
    owner, name = place.split(".")
    flag = tmp_path / "break"
    program = ("-c", PROGRAM.format(flag=str(flag), owner=owner, name=name))
    board = RealTimeBoard(codec, bus)
    told: list[Any] = []
    peer.node.create_subscription(DiagnosticStatus, "/pam_driver/state", told.append, LATCHED)
    domain = peer.context.get_domain_id()
    settings = {"lowering_timeout": 0.3}
    driver = DriverProcess(tmp_path, domain, bus, parameters=settings, program=program)
    try:
        peer.position = [0.1, -0.1]
        peer.until(lambda: board.state is BoardState.ACTIVE or stopped(told), "open valves")
        assert not stopped(told), [status.message for status in told]
        board.pressures = [200e3, 150e3]
        measured = peer.heard["pressure_states"]
        peer.until(lambda: measured and measured[-1].effort[0] > 1e5, "full muscles")
        peer.until(lambda: told and told[-1].message.startswith("active"), "the state")
        flag.touch()
        if name == "on_clear_faults":
            client = peer.node.create_client(*clear_faults())
            peer.until(client.service_is_ready, "service")
            client.call_async(clear_faults()[0].Request())
        if name == "on_deactivate":
            client = peer.node.create_client(*deactivate())
            peer.until(client.service_is_ready, "service")
            request = deactivate()[0].Request()
            request.transition.id = 4
            client.call_async(request)
        peer.until(lambda: driver.process.poll() is not None, "the end of the driver")
        peer.until(
            lambda: told[-1].message.startswith("fault: internal error in "), "the last state"
        )
    finally:
        driver.end()
        board.stop()
    assert driver.wait() == BROKEN
    assert told[-1].level == DiagnosticStatus.ERROR
    states = [status.message.split(":")[0] for status in told]
    assert PLACES[place] in states[states.index("active") :]
    assert board.state is BoardState.FAULT
    assert BoardFault.HOST in board.faults, "the boards keep it when the process has ended"
    lines = [line for line in driver.errors.splitlines() if "rror" in line]
    assert len(lines) == 1, driver.errors
    assert "LookupError: 'nobody\\nforesaw it'" in lines[0]
    assert "Traceback" not in driver.errors


def stopped(told: list[Any]) -> bool:
    """Whether the driver has told of a fault."""
    return any(status.level == DiagnosticStatus.ERROR for status in told)


def clear_faults() -> tuple[type, str]:
    return Trigger, "/pam_driver/clear_faults"


def deactivate() -> tuple[type, str]:
    return ChangeState, "/pam_driver/change_state"


def broken(bench: Bench) -> Driver:
    bench.start()
    bench.board.pressures = [200e3, 150e3]
    bench.cycle(command=True)
    bench.driver.fail("internal error: LookupError", bench.now)
    return bench.driver


def test_the_first_exception_lowers_and_the_second_vents(rig: Rig, codec: BoardCodec) -> None:
    bench = Bench(rig, codec, People())
    driver = broken(bench)
    assert driver.state is SafetyState.FAULT_LOWERING
    assert [fault.kind for fault in driver.faults] == ["internal_error"]
    bench.cycle()
    driver.fail("internal error: another", bench.now)
    assert driver.state is SafetyState.FAULT
    assert [fault.kind for fault in driver.faults] == ["internal_error"]
    bench.cycle()
    assert bench.board.air == (0.0, 0.0)


def test_a_judgement_that_raises_vents_at_once(
    rig: Rig, codec: BoardCodec, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(rig, codec, People())

    def breaks(*_: object) -> None:
        raise ZeroDivisionError

    bench.start()
    monkeypatch.setattr(bench.driver._judge, "conditions", breaks)
    bench.driver.fail("internal error", bench.now)
    assert bench.driver.state is SafetyState.FAULT
    bench.board.step(bench.now)
    assert bench.board.air == (0.0, 0.0)


def test_a_driver_that_is_broken_is_never_activated_again(rig: Rig, codec: BoardCodec) -> None:
    bench = Bench(rig, codec, People())
    broken(bench)
    bench.driver.vent_at_once(bench.now)
    bench.board.pressures = [0.0, 0.0]
    bench.driver.clear_faults(bench.now)
    for _ in range(100):
        bench.cycle()
    assert bench.driver.state is SafetyState.VENTED
    assert "internal error" in bench.driver.activation_problem(bench.now)


def test_an_exception_is_described_in_one_short_line() -> None:
    try:
        raise LookupError("long\n" * 100 + uuid.uuid4().hex)
    except LookupError as error:
        text = described(error)
    assert len(text) < 200
    assert "\n" not in text
    assert "test_driver_breaks.py:" in text
    assert described(ZeroDivisionError()) == "internal error: ZeroDivisionError"
