"""A state of the driver that came and went between two cycles of the controller still stops it."""

from __future__ import annotations

import threading
from typing import Any

import pytest

pytest.importorskip("rclpy")

from pam_control.command_intake import CommandIntake
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.driver_follower import DriverFollower
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.rig import Rig
from pam_ros.driver_state import driver_state_message

STOPS = ("fault", "fault_lowering", "lowering", "venting", "vented", "unconfigured", "nonsense")
MEASURED = 0.1  # rad


class Inside:
    """What of the node follows the driver's state, around a controller that moves."""

    def __init__(self, rig: Rig) -> None:
        self.controller = Controller(rig, ControlSettings())
        self.now = 0.0
        self.dropped: list[str] = []
        lock = threading.Lock()
        self.intake = CommandIntake(self.controller, lock, lambda: self.now, lambda: "", print)
        self.driver = DriverFollower(
            self.controller, self.intake, lock, lambda: self.now, self.dropped.append
        )
        self.hear("active")
        self.dropped.clear()
        self.step()
        point = TrajectoryPoint(3.0, [0.8], [0.0], [0.0])
        self.controller.references.follow(["elbow"], [point], start=None, now=self.now)
        for _ in range(100):
            self.step()
        assert self.speed() > 0.0

    def step(self) -> None:
        self.now += 0.002
        output = self.controller.step(
            self.now, Measurement([MEASURED], [2e5, 2e5], self.now, self.now)
        )
        assert output.commands is not None, output.reason

    def speed(self) -> float:
        return abs(self.controller.references.sample("elbow", self.now).velocity)

    def hear(self, state: str, activation: int = 1) -> None:
        message = driver_state_message("pam_driver", state, "", activation=activation)
        self.driver.take(message)


@pytest.mark.parametrize("state", STOPS)
def test_it_takes_the_joint_over_where_it_is(rig: Rig, state: str) -> None:
    inside = Inside(rig)
    inside.hear(state)
    inside.hear("active")  # before the next cycle, and with the same activation
    assert not inside.controller.active
    assert inside.dropped, "a goal that was followed has ended"
    inside.step()
    assert inside.speed() == 0.0
    assert inside.controller.references.sample("elbow", inside.now).position == MEASURED


def test_states_that_are_lost_in_a_flood_count_as_one_that_stops(rig: Rig) -> None:
    inside = Inside(rig)
    for _ in range(3):
        inside.hear("active")
    assert inside.controller.active
    inside.driver.lose()
    assert not inside.controller.active


def test_a_trajectory_that_was_read_during_a_stop_is_refused(rig: Rig) -> None:
    """It began before the stop; the controller may be active again when it is handed over."""
    inside = Inside(rig)
    references = inside.controller.references
    plan = references.plan

    def slow(*arguments: Any, **named: Any) -> Any:
        planned = plan(*arguments, **named)
        inside.hear("fault")
        inside.hear("active")
        inside.step()
        return planned

    references.plan = slow
    point = TrajectoryPoint(3.0, [0.8], [0.0], [0.0])
    with pytest.raises(CommandError, match="arrived while it was planned"):
        inside.intake.follow(["elbow"], [point], None)
    assert inside.speed() == 0.0
