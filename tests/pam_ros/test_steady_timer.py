"""Nothing that must go on stands still because someone sets the wall clock."""

from __future__ import annotations

import inspect
import time

import pytest

pytest.importorskip("rclpy")

from pam_control import controller_node
from pam_control.actions import follow_trajectory
from pam_driver import driver_node
from pam_gap.experiments.play_node import PlayNode
from pam_sim import rig_node


@pytest.mark.parametrize("module", [controller_node, follow_trajectory, driver_node, rig_node])
def test_nodes_that_keep_real_time_use_no_timer_of_the_wall_clock(module) -> None:
    """A timer of the wall clock is silent for an hour when it is set back by an hour."""
    text = inspect.getsource(module)
    assert "steady_timer(" in text
    assert ".create_timer(" not in text


def test_an_experiment_is_played_by_a_clock_that_nobody_can_set() -> None:
    before = time.monotonic()
    assert before <= PlayNode._now() <= time.monotonic()
