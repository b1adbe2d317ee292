"""A joint is stopped by the speed to which the air in its muscles can drive it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from pam_driver.safety.joint_speed import JointSpeedWatch
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose

ROOT = Path(__file__).parents[2]
PERIOD = 0.002
PRESSURES = (250e3, 250e3)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(ROOT / "config/elbow.yaml")


def swing(
    rig: Rig,
    peak: float,
    rate: float,
    around: float = 0.0,
    pressures: tuple[float, ...] = PRESSURES,
) -> tuple[float, float] | None:
    """The angle and speed at which a swing is stopped that begins at rest; None: it is not.

    `peak` is its largest speed [rad/s], `rate` its circular frequency [rad/s].
    """
    watch, slow = JointSpeedWatch(compose(rig)), 0.5
    now = 0.0
    while now < slow + 2.0 * math.pi / rate:
        # at first the joint moves slowly to where the swing begins
        turn = rate * max(now - slow, 0.0)
        share = min(now / slow, 1.0)
        start = peak / rate * share * share * (3.0 - 2.0 * share)
        angle = around + start * math.cos(turn)
        speed = -peak * math.sin(turn)
        watch.update(pressures, [angle], [speed], [now], now)
        if list(watch.conditions(now)):
            return angle, abs(speed)
        now += PERIOD
    return None


def test_a_joint_that_air_will_drive_too_fast_is_stopped_while_it_is_slow(rig: Rig) -> None:
    limit = rig.joints[0].max_velocity
    found = swing(rig, 1.3 * limit, 25.0)  # the natural frequency at these pressures
    assert found is not None and found[1] < 0.7 * limit


@pytest.mark.parametrize("rate", [2.0 * math.pi * f for f in (0.5, 1.0, 2.0)])
def test_an_ordinary_fast_motion_is_not_stopped(rig: Rig, rate: float) -> None:
    assert swing(rig, 0.8 * rig.joints[0].max_velocity, rate, pressures=(300e3, 200e3)) is None


def test_softer_air_drives_farther(rig: Rig) -> None:
    """The same acceleration leads to a higher speed where the muscles are less stiff."""
    limit = rig.joints[0].max_velocity
    assert swing(rig, 0.75 * limit, 25.0, pressures=(400e3, 400e3)) is None
    assert swing(rig, 0.75 * limit, 25.0, pressures=(60e3, 60e3)) is not None


def test_a_regulator_holds_its_pressure_so_that_its_gas_is_no_spring(rig: Rig) -> None:
    regulated = replace(
        rig,
        muscles=tuple(
            replace(
                muscle,
                valve=replace(muscle.valve, kind="pressure_regulator", full_scale=6e5),
            )
            for muscle in rig.muscles
        ),
    )
    limit = rig.joints[0].max_velocity
    assert swing(rig, 0.75 * limit, 25.0) is None
    assert swing(regulated, 0.75 * limit, 25.0) is not None


def test_an_end_stop_is_no_spring(rig: Rig) -> None:
    """A joint that meets its end stop decelerates suddenly; no air drives it."""
    watch = JointSpeedWatch(compose(rig))
    end = rig.joints[0].position_limits[1]
    for step in range(200):
        now = step * PERIOD
        angle = min(0.9 + 1.5 * now, end)
        watch.update(PRESSURES, [angle], [1.5 if angle < end else 0.0], [now], now)
        assert not list(watch.conditions(now))


def test_a_missing_measurement_is_no_motion(rig: Rig) -> None:
    watch = JointSpeedWatch(compose(rig))
    for step in range(50):
        now = step * PERIOD
        missing = 10 < step < 20
        speed = math.nan if missing else 1.0
        watch.update([math.nan] * 2 if missing else PRESSURES, [0.1], [speed], [now], now)
        assert not list(watch.conditions(now))
    for step in range(50, 60):
        now = step * PERIOD
        watch.update(PRESSURES, [0.1], [7.0], [now], now)
    (found,) = watch.conditions(now)
    assert found.kind == "joint_too_fast" and found.text.startswith("at 7.00 rad/s")


def test_noise_of_the_speed_is_not_speed(rig: Rig) -> None:
    """A speed whose sign changes all the time is that of an encoder, not of a joint."""
    watch = JointSpeedWatch(compose(rig))
    for step in range(100):
        now = step * PERIOD
        watch.update(PRESSURES, [0.1], [7.0 * (-1.0) ** (step // 2)], [now], now)
        assert not list(watch.conditions(now))
