"""The start of the driver node, inside the process of a test: it waits, gives up, is cancelled."""

from __future__ import annotations

import pytest
import rclpy
from rclpy.lifecycle import TransitionCallbackReturn
from std_srvs.srv import Trigger

from pam_driver import driver_assembly
from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardFault,
    BoardState,
)
from pam_driver.can_bus.bus import CanPort
from pam_driver.can_bus.bus_opening import BusError
from pam_driver.safety.states import SafetyState
from pam_ros.errors import ParameterError

from .node_inside import TIMEOUT, Inside

pytestmark = pytest.mark.system


def test_autostart_gives_up_after_its_time_and_a_late_board_starts_nothing(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    """No robot starts by itself when someone plugs it in later."""
    node = inside.node
    assert node.autostart()
    node._watch()
    assert "not activated" not in capfd.readouterr().err
    inside.ahead = TIMEOUT + 1.0
    node._watch()
    assert "not activated: no answer from board 0" in capfd.readouterr().err
    inside.ahead = 0.0
    inside.answer(inside.healthy)
    node._watch()
    assert not inside.is_active()
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    assert inside.is_active()


def test_autostart_measures_and_leaves_moving_air_to_a_person(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    assert inside.node.autostart()
    inside.answer(inside.healthy)
    for _ in range(3):
        inside.node._watch()
    assert not inside.is_active()
    driver = inside.node._driver
    assert driver is not None
    assert driver.state is SafetyState.VENTED
    told = capfd.readouterr().err
    assert told.count("to move: ros2 lifecycle set /pam_driver activate") == 1
    assert inside.node.trigger_activate() == TransitionCallbackReturn.SUCCESS


def test_a_start_that_is_asked_to_activate_waits_for_the_board(eager: Inside) -> None:
    assert eager.node.autostart()
    eager.answer(eager.healthy)
    eager.ahead = TIMEOUT - 1.0
    eager.node._watch()  # the node's clock says: silent for long
    assert not eager.is_active()
    eager.ahead = 0.0
    eager.answer(eager.healthy)
    eager.node._watch()
    assert eager.is_active()


def test_activation_at_start_without_autostart_is_a_mistake(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec
) -> None:
    try:
        with pytest.raises(ParameterError, match="activate_on_start: true needs autostart: true"):
            Inside(monkeypatch, codec, ("activate_on_start", "true"), ("autostart", "false"))
    finally:
        rclpy.try_shutdown()


def test_a_refused_activation_says_why_after_autostart_has_ended(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    assert inside.node.autostart()
    inside.ahead = TIMEOUT + 1.0
    inside.node._watch()
    inside.ahead = 0.0
    capfd.readouterr()
    assert inside.node.trigger_activate() != TransitionCallbackReturn.SUCCESS
    assert "not activated: no answer from board 0" in capfd.readouterr().err


def test_a_refused_configuration_says_why_after_autostart_has_ended(
    inside: Inside, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    node = inside.node
    assert node.autostart()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS

    def gone(*arguments: object, **options: object) -> CanPort:
        raise BusError("CAN bus socketcan can0: no such interface")

    monkeypatch.setattr(driver_assembly, "open_buses", gone)
    capfd.readouterr()
    assert node.trigger_configure() != TransitionCallbackReturn.SUCCESS
    assert "can0: no such interface" in capfd.readouterr().err


def test_a_stop_before_the_board_answers_cancels_the_start(eager: Inside) -> None:
    """An operator who calls ~/vent while autostart waits must not see the arm fill later."""
    node = eager.node
    assert node.autostart()
    answer = node._calls.on_vent(Trigger.Request(), Trigger.Response())
    assert answer.success
    assert "cancelled" in answer.message
    eager.answer(eager.healthy)
    node._watch()
    assert not eager.is_active()


def test_a_fault_before_the_start_cancels_it_even_when_it_is_cleared(
    eager: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    """Clearing a fault is no request to move."""
    node = eager.node
    eager.board.state, eager.board.faults = BoardState.FAULT, BoardFault.WATCHDOG
    assert node.autostart()
    driver = node._driver
    assert driver is not None
    eager.answer(lambda: any(one.kind == "board_fault" for one in driver.conditions))
    node._watch()
    assert "the activation at start-up is cancelled by board 0: " in capfd.readouterr().err
    assert node._calls.on_clear_faults(Trigger.Request(), Trigger.Response()).success
    eager.answer(eager.healthy)
    node._watch()
    assert not eager.is_active()


def test_a_clean_up_before_the_start_cancels_it(
    eager: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    node = eager.node
    assert node.autostart()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert "the activation at start-up is cancelled by a clean-up" in capfd.readouterr().err
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    eager.answer(eager.healthy)
    node._watch()
    assert not eager.is_active()
