"""People are heard until the driver's process has ended, also while its end lowers the arm."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from std_msgs.msg import Bool

from pam_driver.boards.pam_board.codec import BoardCode, BoardCodec
from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH
from pam_driver.driver_parameters import PEOPLE_TOPICS
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from support.reruns import HOST_STALLS

from .node_bench import NAMES
from .node_inside import Inside

pytestmark = pytest.mark.system

LOWERING = 1.0  # s, several times the deadline
DEADLINE = 0.25  # s


def ended(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec, name: str, permits: Callable[[float], bool]
) -> tuple[float, bool]:
    """End a node that holds a joint.

    `permits` says what the topic of the input `name` tells, by the time since the end began [s].
    Returns how long the joint was lowered [s], and whether the boards were told to keep a fault.
    """
    extra = (
        (f"people.{name}_topic", "true"),
        ("people.deadline", DEADLINE),
        ("lowering_timeout", LOWERING),
    )
    inside = Inside(monkeypatch, codec, *extra)
    node, board = inside.node, inside.board
    topic = node.create_publisher(Bool, f"/pam_driver/{PEOPLE_TOPICS[name][2:]}", 1)
    began = float("inf")
    over = threading.Event()

    def person_and_board() -> None:
        while not over.wait(0.005):
            topic.publish(Bool(data=permits(time.monotonic() - began)))
            board.step(time.monotonic())

    thread = threading.Thread(target=person_and_board)
    try:
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        driver = node._driver
        assert driver is not None
        thread.start()
        end = time.monotonic() + 20.0
        while not inside.healthy():
            assert time.monotonic() < end, driver.activation_problem(time.monotonic())
            time.sleep(0.01)
        assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        driver.set_commands(NamedCommand(NAMES, position=(0.0, 0.0)), time.monotonic())
        board.pressures = [200e3, 200e3]  # there is something to lower
        while driver._exhausts.empty:
            assert time.monotonic() < end, driver.activation_problem(time.monotonic())
            time.sleep(0.005)
        assert driver.state is SafetyState.ACTIVE, driver.faults
        began = time.monotonic()
        node.close()
        took = time.monotonic() - began
    finally:
        over.set()
        thread.join()
        inside.close()
    return took, BoardCode.LATCH_FAULT in [told.code for told in board.board_commands]


@pytest.mark.sampled("one of the two cases", cases=1)
@pytest.mark.rerun_because(HOST_STALLS)
@pytest.mark.parametrize("name", [EMERGENCY_STOP, ENABLING_SWITCH])
def test_an_end_lowers_the_arm_while_people_permit_motion(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec, name: str
) -> None:
    """Ctrl-C must not drop an arm because nobody listens to the permission any more."""
    took, latched = ended(monkeypatch, codec, name, lambda _: True)
    assert took > 0.9 * LOWERING
    assert not latched


@pytest.mark.rerun_because(HOST_STALLS)
def test_an_emergency_stop_during_the_end_vents_at_once(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec
) -> None:
    took, latched = ended(monkeypatch, codec, EMERGENCY_STOP, lambda since: since < 0.1)
    assert took < 0.6 * LOWERING
    assert latched
