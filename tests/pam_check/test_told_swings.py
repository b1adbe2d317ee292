"""Swings of rigs with hidden effects are told within three seconds, with their likely cause."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from pam_check.blind.effect_cases import size_of
from pam_check.blind.truth_plant import Sensors, TruthJoint
from pam_check.control.closed_loop import PERIOD, SETTLED, START_PRESSURE, TOLD, Muscles
from pam_check.control.rough_control import RoughControl
from pam_check.control.running_truth import RunningTruth
from pam_control.control_step import Measurement
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
TOLD_WITHIN = 3.0  # s after the motion began
pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")


@pytest.fixture(scope="module")
def rough():
    return RoughControl(load_rig(ELBOW), TOLD, 5)


def hidden(
    rough: RoughControl, effects: Sequence[str], late: float = 0.0, **friction: float
) -> tuple[TruthJoint, Muscles]:
    """The rig with several effects, a delay of the commands [s] and friction."""
    joint, muscles = rough.hidden("nothing")
    joint = joint._replace(**friction)
    for effect in effects:
        joint, muscles = size_of(effect).applied(joint, muscles)
    return joint, tuple(muscle._replace(command_delay=late) for muscle in muscles)


def first_told(rough, rig, points, seed):
    """When the controller first tells or does something about swings [s], and what it tells."""
    controller = rough.controller
    controller.drop_commands()
    controller.forget_adaptation()
    count = round((SETTLED + points[-1].time_from_start) / PERIOD)
    plant = RunningTruth(
        *rig, Sensors(), np.random.default_rng(seed), period=PERIOD, count=count,
        pressure=START_PRESSURE,
    )  # fmt: skip
    commands = (0.0, 0.0)
    for k in range(count):
        now = k * PERIOD
        shown = plant.advance(commands)
        if k == round(SETTLED / PERIOD):
            controller.references.follow(["elbow"], points, start=None, now=now)
        output = controller.step(now, Measurement([shown[2]], [shown[0], shown[1]], now, now))
        guard = controller.guard
        told = guard.swings or guard.softened or guard.stopped
        if told:
            return now - SETTLED, told
        assert output.commands is not None
        commands = (output.commands[0], output.commands[1])
    return None


@pytest.mark.parametrize(
    ("effects", "late", "motion", "causes"),
    [
        (["stribeck_friction"], 0.0, "chirp", ("dry friction that sticks",)),
        ([], 0.024, "arm", ("a delay",)),
        ([], 0.03, "arm", ("likely cause: a delay",)),
        (["hysteresis"], 0.019, "arm", ("a delay",)),
        (["tube_restriction", "stribeck_friction"], 0.0, "chirp", ("a tube",)),
    ],
    ids=["friction", "24 ms", "30 ms", "hysteresis and 19 ms", "tube and friction"],
)
def test_swings_are_told_within_three_seconds_with_their_likely_cause(
    rough, effects, late, motion, causes
):
    found = first_told(rough, hidden(rough, effects, late), rough.motions[motion], 5)
    assert found is not None
    time, told = found
    assert time < TOLD_WITHIN
    assert any(cause in told for cause in causes), told


@pytest.mark.parametrize(("sliding", "breakaway", "speed"), [(0.25, 0.5, 0.1), (0.4, 0.8, 0.05)])
def test_friction_that_falls_with_speed_is_not_told_as_a_delay_alone(
    rough, sliding, breakaway, speed
):
    """Its cycle is so soft that the joint does not stop; its torque takes work all the time."""
    friction = {"coulomb_torque": sliding, "static_torque": breakaway, "stribeck_speed": speed}
    found = first_told(rough, hidden(rough, [], **friction), rough.motions["chirp"], 5)
    assert found is not None
    time, told = found
    assert time < TOLD_WITHIN
    assert "likely cause: dry friction" in told


@pytest.mark.parametrize("effect", ["nothing", "coulomb_friction", "payload", "position_delay"])
def test_nothing_is_told_of_an_ordinary_motion(rough, effect):
    for points in rough.motions.values():
        assert (
            first_told(rough, hidden(rough, [] if effect == "nothing" else [effect]), points, 5)
            is None
        )
