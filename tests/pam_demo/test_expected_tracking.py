"""A commissioning knows how well its joint should track, and says when it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from pam_control.controller import Controller
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.expected_tracking import (
    Expected,
    NoisyPort,
    SensorNoise,
    at_deviations,
    doubt,
    expected,
)
from pam_demo.commission.knowledge import Known
from pam_demo.commission.motion_loop import scale_of
from pam_demo.commission.page import render
from pam_demo.commission.simulated_port import SimulatedPort
from pam_demo.commission.tracking import Tracked, controller_for, reaches, track
from pam_demo.commission.watch import Limits
from pam_gap.calibration.calibration import NARROWED, CalibratedNumber
from pam_gap.inference.confidence import NORMAL_90
from pam_model.rig import Rig, load_rig

PERIOD = 0.004
NOISE = SensorNoise(1e-4, (150.0, 150.0))
KEYS = ("elbow.inertia", "elbow.viscous_friction")


@pytest.fixture(scope="module")
def elbow() -> Rig:
    return load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")


@pytest.fixture(scope="module")
def known(elbow: Rig) -> tuple[Known, ...]:
    joint = elbow.joints[0]
    return (
        Known("joint.inertia", KEYS[0], joint.inertia, 0.9 * joint.inertia, 1.1 * joint.inertia),
        Known("joint.viscous_friction", KEYS[1], joint.viscous_friction,
              0.98 * joint.viscous_friction, 1.02 * joint.viscous_friction),
        Known("supply_pressure", "supply_pressure", *(elbow.supply_pressure,) * 3),
    )  # fmt: skip


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
    elbow: Rig, known: tuple[Known, ...], test_of: Callable[[NoisyPort], Tracked]
) -> Expected:
    return expected(elbow, known, {}, NOISE, PERIOD, test_of)


def test_a_joint_that_is_as_identified_is_not_doubted(
    elbow: Rig,
    on_robots: Expected,
    numbers: tuple[CalibratedNumber, ...],
    test_of: Callable[[SimulatedPort], Tracked],
) -> None:
    assert len(on_robots.errors) == 5  # the design of two numbers, and the most likely robot
    measured = test_of(SimulatedPort(elbow, PERIOD)).rms
    assert measured < on_robots.errors[-1]
    assert doubt(measured, on_robots, numbers) == "" or on_robots.is_wide


@pytest.mark.parametrize(
    "changes", [{"joint.inertia": 1.6}, {"coulomb_friction.torque": 0.6}]
)
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
    assert "most on elbow.inertia (faster motion" in text
    done = Commissioned(after=measured, expected=on_robots, doubt=text)
    page = render("elbow", done)
    assert "worse than its numbers predict" in page
    assert "mrad RMS" in page


def test_numbers_that_leave_the_tracking_open_are_told(
    numbers: tuple[CalibratedNumber, ...],
) -> None:
    wide = Expected((1e-3, 2e-3, math.inf), (KEYS[1],))
    assert "leave open" in doubt(1.5e-3, wide, numbers)
    assert "elbow.viscous_friction (faster motion that overshoots" in doubt(1.5e-3, wide, numbers)


def test_ends_of_an_interval_become_those_of_a_standard_deviation() -> None:
    one, other = at_deviations(
        [Known("joint.inertia", KEYS[0], 2.0, 1.0, 4.0), Known("x", "x", 0.0, -1.0, 2.0)]
    )
    assert math.log(one.high / 2.0) == pytest.approx(math.log(2.0) / NORMAL_90)
    assert (other.low, other.high) == pytest.approx((-1.0 / NORMAL_90, 2.0 / NORMAL_90))
