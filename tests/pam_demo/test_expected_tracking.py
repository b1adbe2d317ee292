"""A commissioning knows how well its joint should track, and says when it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.expected_tracking import (
    Expected,
    NoisyPort,
    SensorNoise,
    doubt,
    expected,
)
from pam_demo.commission.motion_loop import scale_of
from pam_demo.commission.page import render
from pam_demo.commission.simulated_port import SimulatedPort
from pam_demo.commission.tracking import Tracked, controller_for, reaches, track
from pam_demo.commission.watch import Limits
from pam_gap.calibration.calibration import NARROWED, CalibratedNumber
from pam_gap.calibration.free_numbers import BODY, FreeRigNumber
from pam_gap.calibration.posterior import Posterior
from pam_gap.prediction.fit import FreeParameter
from pam_model.rig import Rig, load_rig

PERIOD = 0.004
NOISE = SensorNoise(1e-4, (150.0, 150.0))
KEYS = ("elbow.inertia", "elbow.viscous_friction")


@pytest.fixture(scope="module")
def elbow() -> Rig:
    return load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")


@pytest.fixture(scope="module")
def posterior(elbow: Rig) -> Posterior:
    """Inertia and friction of the elbow, off by 3 and 1 %."""
    joint = elbow.joints[0]
    values = np.array([joint.inertia, joint.viscous_friction])
    numbers = tuple(
        FreeRigNumber(
            key.replace("elbow", "joint"), key, "-", BODY,
            FreeParameter(key, 0.1 * value, 10.0 * value, 0.1, 0.2, value, True), value,
        )
        for key, value in zip(KEYS, values.tolist(), strict=True)
    )  # fmt: skip
    return Posterior(numbers, values, np.diag([0.03, 0.01]) ** 2)


@pytest.fixture(scope="module")
def numbers(elbow: Rig) -> tuple[CalibratedNumber, ...]:
    return tuple(CalibratedNumber(key, "-", "body", 1.0, 1.0, 0.9, 1.1, NARROWED) for key in KEYS)


@pytest.fixture(scope="module")
def test_of(elbow: Rig) -> Callable[[SimulatedPort | NoisyPort], Tracked]:
    """The tracking test of the elbow."""
    scale, limits = scale_of(elbow, PERIOD), Limits.of(elbow)
    controller: Controller = controller_for(SimulatedPort(elbow, PERIOD), elbow)
    points = reaches(scale.middle, scale.reach, 0.8)
    return lambda port: track(port, controller, points, limits)


@pytest.fixture(scope="module")
def on_robots(
    elbow: Rig, posterior: Posterior, test_of: Callable[[NoisyPort], Tracked]
) -> Expected:
    return expected(elbow, posterior, NOISE, PERIOD, test_of)


def test_a_joint_that_is_as_identified_is_not_doubted(
    elbow: Rig,
    on_robots: Expected,
    numbers: tuple[CalibratedNumber, ...],
    test_of: Callable[[SimulatedPort], Tracked],
) -> None:
    measured = test_of(SimulatedPort(elbow, PERIOD)).rms
    assert measured < on_robots.errors[-1]
    assert doubt(measured, on_robots, numbers) == ""


@pytest.mark.parametrize("changes", [{"joint.inertia": 3.0}, {"coulomb_friction.torque": 0.6}])
def test_a_joint_that_is_worse_than_its_numbers_predict_is_told_with_what_to_do(
    elbow: Rig,
    on_robots: Expected,
    numbers: tuple[CalibratedNumber, ...],
    test_of: Callable[[SimulatedPort], Tracked],
    changes: dict[str, float],
) -> None:
    changed = dict(changes)
    if "joint.inertia" in changed:
        changed["joint.inertia"] *= elbow.joints[0].inertia
    measured = test_of(SimulatedPort(elbow, PERIOD, changed))
    text = doubt(measured.rms, on_robots, numbers)
    assert "worse than its numbers predict" in text
    assert "elbow.inertia (faster motion" in text
    done = Commissioned(after=measured, expected=on_robots, doubt=text)
    page = render("elbow", done)
    assert "worse than its numbers predict" in page
    assert "mrad RMS" in page


def test_numbers_that_leave_the_tracking_open_are_told(
    numbers: tuple[CalibratedNumber, ...],
) -> None:
    wide = Expected((1e-3, 2e-3, math.inf), (KEYS[1],), 1.2e-3)
    text = doubt(1.9e-3, wide, numbers)
    assert "1.00 mrad to a test that is not followed to its end" in text
    assert "a robot with exactly these numbers would track with 1.20 mrad" in text
    assert "elbow.viscous_friction (faster motion that overshoots" in text
    assert not doubt(1.7e-3, wide, numbers)


def test_what_known_numbers_give_does_not_grow_with_what_is_left_open(
    elbow: Rig,
    posterior: Posterior,
    on_robots: Expected,
    test_of: Callable[[NoisyPort], Tracked],
) -> None:
    open_ones = replace(posterior, covariance=np.diag([0.5, 0.3]) ** 2)
    wide = expected(elbow, open_ones, NOISE, PERIOD, test_of)
    assert wide.errors[len(wide.errors) // 2] > 1.5 * on_robots.errors[len(on_robots.errors) // 2]
    assert wide.known == pytest.approx(on_robots.known, rel=0.1)
    # the error of the middle robot is nothing that a joint should have
    assert doubt(wide.errors[len(wide.errors) // 2], wide, ())


def test_robots_are_drawn_from_combinations_that_a_log_fixes(posterior: Posterior) -> None:
    both = replace(posterior, covariance=0.04 * np.array([[1.0, 0.999], [0.999, 1.0]]))
    drawn = both.robots(200, np.random.default_rng(1))
    inertia, friction = (
        np.log([robot[name] / value for robot in drawn])
        for name, value in zip(
            ("joint.inertia", "joint.viscous_friction"), both.values.tolist(), strict=True
        )
    )
    assert np.std(inertia) == pytest.approx(0.2, rel=0.2)
    assert np.std(inertia - friction) < 0.02
