"""Commissions over ROS: the boards have the true numbers, the driver has the rough ones."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pam_check.calibration.commission_campaign import drawn_with_file, true_rig_file
from pam_check.calibration.commission_over_ros import (
    RATE,
    RosResult,
    on_a_board,
    simulated_robot,
)
from pam_demo.chain import set_environment
from pam_demo.commission.ros_port_node import open_ros_port
from pam_model.rig import load_rig


def test_a_robot_tracks_within_half_more_than_with_the_true_file() -> None:
    good = RosResult(0, 300.0, (0.6, 0.5, 0.4), 3e-3, 1e-3, 1.4e-3, 1e-3)
    assert good.tracks
    assert not RosResult(0, 300.0, (0.6, 0.5, 0.4), 3e-3, 1e-3, 1.6e-3, 1e-3).tracks
    assert not RosResult(0, 20.0, (math.nan,) * 3, said="ended").tracks
    never = RosResult(0, 300.0, (0.6, 0.5, 0.4), after=math.inf, true=math.inf)
    assert not never.tracks


@pytest.mark.system
def test_the_boards_simulate_the_true_robot_and_the_driver_has_the_rough_file(
    tmp_path: Path,
) -> None:
    drawn, _, partial = drawn_with_file(0, np.random.default_rng([620401, 0]), tmp_path)
    partial = on_a_board(partial)
    true = true_rig_file(partial.rig, drawn)
    name = partial.rig.joints[0].name
    with simulated_robot(partial.rig, true, tmp_path) as chain:
        assert load_rig(tmp_path / "driver.yaml").joints != load_rig(tmp_path / "true.yaml").joints
        with (
            set_environment(chain.environment),
            open_ros_port(partial.rig, name, 1.0 / RATE) as port,
        ):
            empty = tuple(-1.0 if m.valve.kind == "flow" else 0.0 for m in partial.rig.muscles)
            reading = port.advance(empty)
    assert max(reading.pressures) < 2e4
    low, high = true.joints[0].position_limits
    assert low <= reading.position <= high
    assert "exit code 0" in (tmp_path / "driver.log").read_text()
