"""Estimates: matched by name, stamped with the measurement, NaN if one is missing or too old."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from pam_model.joints.joint_estimator import JointEstimator
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import load_rig
from pam_model.robot import compose

RIG = load_rig(Path(__file__).parents[2] / "config" / "two_joints.yaml")
NAMES = list(RIG.muscle_names)
PRESSURES = [3e5, 2e5, 1e5, 1.5e5]


def fed(estimator: JointEstimator, stamp: float = 10.0) -> JointEstimator:
    assert estimator.take_pressures(stamp, NAMES, PRESSURES) == 4
    assert (
        estimator.take_positions(stamp - 0.01, ["elbow", "shoulder"], [0.2, 0.1], [0.5, -0.5]) == 2
    )
    return estimator


def test_agrees_with_the_joints() -> None:
    estimate = fed(JointEstimator(compose(RIG))).estimate(10.02)
    assert estimate.stamp == 10.0
    assert estimate.problems == []
    for index, (name, position) in enumerate((("shoulder", 0.1), ("elbow", 0.2))):
        joint = JointStatics.from_rig(RIG, name)
        pair = PRESSURES[2 * index], PRESSURES[2 * index + 1]
        both = slice(2 * index, 2 * index + 2)
        assert estimate.joint_torques[index] == joint.torque(pair, position)
        assert estimate.joint_stiffnesses[index] == joint.stiffness(pair, position)
        assert tuple(estimate.muscle_lengths[both]) == joint.lengths(position)
        assert tuple(estimate.muscle_forces[both]) == joint.tensions(pair, position)
    assert estimate.muscle_speeds == pytest.approx([0.02, -0.02, -0.015, 0.015])


def test_order_of_names_does_not_matter() -> None:
    estimator = JointEstimator(compose(RIG))
    estimator.take_pressures(10.0, NAMES[::-1], PRESSURES[::-1])
    estimator.take_positions(10.0, ["shoulder", "wrist", "elbow"], [0.1, 9.0, 0.2], [])
    ordered = fed(JointEstimator(compose(RIG))).estimate(10.0)
    assert estimator.estimate(10.0).joint_torques == ordered.joint_torques


def test_nothing_is_known_at_first() -> None:
    estimate = JointEstimator(compose(RIG)).estimate(1.0)
    assert estimate.stamp is None
    assert all(math.isnan(value) for value in estimate.muscle_forces + estimate.joint_torques)
    assert "shoulder: no position was received yet" in estimate.problems


def test_old_values_are_no_values() -> None:
    estimator = fed(JointEstimator(compose(RIG), max_age=0.1))
    assert not any(math.isnan(value) for value in estimator.estimate(10.05).joint_torques)
    late = estimator.estimate(10.2)
    assert all(math.isnan(value) for value in late.muscle_lengths + late.joint_stiffnesses)
    assert "shoulder: position is 0.21 s old, limit 0.1 s" in late.problems


def test_values_from_the_future_are_no_values() -> None:
    estimate = fed(JointEstimator(compose(RIG), max_age=0.1)).estimate(5.0)
    assert all(math.isnan(value) for value in estimate.joint_torques)


@pytest.mark.parametrize("missing", [math.nan, math.inf])
def test_one_missing_pressure_leaves_the_rest(missing: float) -> None:
    estimator = fed(JointEstimator(compose(RIG)))
    full = estimator.estimate(10.0)
    estimator.take_pressures(10.0, ["elbow_extensor"], [missing])
    estimate = estimator.estimate(10.0)
    assert estimate.joint_torques[0] == full.joint_torques[0]
    assert math.isnan(estimate.joint_torques[1])
    assert math.isnan(estimate.joint_stiffnesses[1])
    assert estimate.muscle_forces[2] == full.muscle_forces[2]
    assert math.isnan(estimate.muscle_forces[3])
    assert estimate.muscle_lengths == full.muscle_lengths


def test_short_arrays_are_missing_values() -> None:
    estimator = JointEstimator(compose(RIG))
    estimator.take_pressures(10.0, NAMES, PRESSURES[:3])
    estimator.take_positions(10.0, ["elbow", "shoulder"], [0.2], [])
    estimate = estimator.estimate(10.0)
    assert all(math.isnan(value) for value in estimate.joint_torques)
    assert math.isnan(estimate.muscle_lengths[0])
    assert not math.isnan(estimate.muscle_lengths[2])
    assert math.isnan(estimate.muscle_speeds[2])


def test_position_that_no_model_covers() -> None:
    estimator = fed(JointEstimator(compose(RIG)))
    estimator.take_positions(10.0, ["elbow"], [5.0], [0.0])
    estimate = estimator.estimate(10.0)
    assert math.isnan(estimate.joint_torques[1])
    assert not math.isnan(estimate.joint_torques[0])
    assert any(line.startswith("elbow at 5 rad: length") for line in estimate.problems)


def test_sensor_errors_of_the_rig_file_are_taken_out() -> None:
    muscle, joint = RIG.muscle("elbow_flexor"), RIG.joint("elbow")
    rig = RIG.with_muscle(
        replace(muscle, effects={"pressure_gain": {"gain": 1.1}, "pressure_bias": {"bias": 5e3}})
    ).with_joint(replace(joint, effects={"position_offset": {"offset": 0.05}}))
    estimator = fed(JointEstimator(compose(rig)))
    estimator.take_pressures(10.0, ["elbow_flexor"], [1e5 * 1.1 + 5e3])
    estimator.take_positions(10.0, ["elbow"], [0.25], [0.5])
    plain = fed(JointEstimator(compose(RIG))).estimate(10.0)
    assert estimator.estimate(10.0).joint_torques == pytest.approx(plain.joint_torques)


def test_shut_chambers_are_stiffer() -> None:
    fixed = fed(JointEstimator(compose(RIG))).estimate(10.0).joint_stiffnesses
    shut = fed(JointEstimator(compose(RIG), closed_chambers=True)).estimate(10.0).joint_stiffnesses
    assert all(more > less for more, less in zip(shut, fixed, strict=True))


def test_a_late_message_does_not_replace_a_newer_one() -> None:
    estimator = fed(JointEstimator(compose(RIG)))
    expected = estimator.estimate(10.02).joint_torques
    estimator.take_pressures(9.95, NAMES, [0.0] * 4)
    estimator.take_positions(9.95, ["elbow", "shoulder"], [0.0, 0.0], [0.0, 0.0])
    assert list(estimator.estimate(10.02).joint_torques) == list(expected)


def test_a_clock_set_back_does_not_freeze_the_estimate() -> None:
    estimator = fed(JointEstimator(compose(RIG)))
    fed(estimator, stamp=5.0)
    assert estimator.estimate(5.02).problems == []
