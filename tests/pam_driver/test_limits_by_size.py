"""Limits of plausibility of rigs that are not the elbow of config/."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_driver.safety import limits_by_size as by_size
from pam_model.rig import Plausibility
from pam_model.rig.parser import parse_rig
from pam_model.robot import compose
from pam_model.views.pressure_rate import filling_rate

LIMITS = {
    "pressure_residual": lambda rig: of_muscle(by_size.pressure_residual, rig),
    "pressure_noise": lambda rig: of_muscle(by_size.pressure_noise, rig),
    "pressure_rate": lambda rig: of_muscle(by_size.pressure_rate_limit, rig),
    "position_jump": lambda rig: of_joint(by_size.position_jump, rig),
    "position_noise": lambda rig: of_joint(by_size.position_noise, rig),
}


def of_muscle(limit, rig) -> float:
    robot = compose(rig)
    return limit(robot, robot.muscles[0])


def of_joint(limit, rig) -> float:
    robot = compose(rig)
    return limit(robot, robot.joints[0])


def with_valve(rig, share: float):
    muscle = rig.muscles[0]
    valve = replace(muscle.valve, sonic_conductance=share * muscle.valve.sonic_conductance)
    return rig.with_muscle(replace(muscle, valve=valve))


def with_pressure(rig, pressure: float):
    return rig.with_muscle(replace(rig.muscles[0], max_pressure=pressure))


def test_the_elbow_has_the_limits_that_the_pages_name(rig):
    found = {name: limit(rig) for name, limit in LIMITS.items()}
    assert found == pytest.approx(
        {
            "pressure_residual": 100e3,
            "pressure_noise": 10e3,
            "pressure_rate": 5e6,
            "position_jump": 0.2,
            "position_noise": 0.02,
        },
        rel=1e-6,
    )


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_of_the_rig_file_counts(rig, name):
    given = replace(rig, plausibility=Plausibility(**{name: 0.125}))
    assert LIMITS[name](given) == 0.125


def test_no_deviation_is_asked_for_that_the_valve_or_the_muscle_cannot_give(rig):
    """A valve that fills slowly never deviates by 100 kPa, and neither does a muscle of 2 bar."""
    residual = LIMITS["pressure_residual"]
    slow = with_valve(rig, 0.35)
    assert residual(slow) == pytest.approx(0.3 * of_muscle(filling_rate, slow) / 5.0)
    assert residual(slow) < 40e3
    assert residual(with_valve(rig, 1e-3)) == pytest.approx(0.05 * 6e5)  # an error of a sensor
    assert residual(with_valve(rig, 10.0)) == pytest.approx(100e3)
    assert residual(with_pressure(rig, 2e5)) == pytest.approx(2e5 / 6.0)


def test_a_fast_valve_is_no_step_of_the_pressure(rig):
    """A muscle that its valve fills within 60 ms is a healthy one."""
    fast = with_valve(rig, 5.0)
    rate = of_muscle(filling_rate, fast)
    assert rate > 5e6
    assert LIMITS["pressure_rate"](fast) == pytest.approx(2.7 * rate)


def test_noise_and_jumps_are_measured_by_pressure_range_and_speed(rig):
    assert LIMITS["pressure_noise"](with_pressure(rig, 1.2e6)) == pytest.approx(20e3)
    joint = rig.joints[0]
    narrow = rig.with_joint(replace(joint, position_limits=(-0.1, 0.1), max_velocity=1.5))
    assert LIMITS["position_noise"](narrow) == pytest.approx(0.002)
    assert LIMITS["position_jump"](narrow) == pytest.approx(0.05)


def test_a_rig_file_may_leave_them_open_and_keeps_them_open(rig):
    tree = rig.to_parameters()
    assert "plausibility" not in tree
    again = parse_rig(tree, "rig.yaml")
    assert again.plausibility == Plausibility()


@pytest.mark.parametrize(("limits", "error"), [((-0.1, 0.1), 0.05), ((-1.05, 1.05), 0.5)])
def test_a_tracking_error_of_more_than_a_quarter_of_the_range_is_not_borne(rig, limits, error):
    """Half a radian cannot be reached by a joint that travels 0.2 rad."""
    tree = rig.to_parameters()
    del tree["elbow"]["max_tracking_error"]
    tree["elbow"]["position_limits"] = list(limits)
    assert parse_rig(tree, "rig.yaml").joints[0].max_tracking_error == pytest.approx(error)


def test_a_sensor_behind_a_tube_steps_faster_than_the_muscle(rig):
    """The gas at the sensor is that of the tube, which the open valve fills in no time."""
    muscle = rig.muscles[0]
    tube = {"tube_restriction": {"conductance": 2e-9, "volume": 1e-5}}
    far = rig.with_muscle(replace(muscle, effects=tube))
    volume = float(rig.force_model(muscle.name).volume(muscle.neutral_length)) + muscle.dead_volume
    rate = of_muscle(filling_rate, rig) * volume / 1e-5
    assert LIMITS["pressure_rate"](far) == pytest.approx(2.7 * rate)
