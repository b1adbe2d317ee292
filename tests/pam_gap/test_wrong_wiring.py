"""Channels that are swapped or reversed are told before a cause is sought for them."""

from dataclasses import replace

import numpy as np
import pytest

from pam_gap.prediction.directions import Direction, cross_phase, directions
from pam_gap.prediction.identifiable import what_is_missing
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, Recording
from pam_gap.rules import DEFAULT
from pam_model.rig import Rig

from .conftest import Maker

FLEXOR, EXTENSOR = "elbow_flexor", "elbow_extensor"
POSITION = "joint_states.elbow.position"


def swapped(recording: Recording, *kinds: str) -> Recording:
    values = dict(recording.values)
    for kind in kinds:
        first, second = f"{kind}.{FLEXOR}", f"{kind}.{EXTENSOR}"
        values[first], values[second] = values[second], values[first]
    return replace(recording, values=values)


def turned(recording: Recording, *channels: str) -> Recording:
    changed = {name: -recording.values[name] for name in channels}
    return replace(recording, values={**recording.values, **changed})


def missing(rig: Rig, recording: Recording) -> tuple[str, ...]:
    return what_is_missing(PredictionProblem(rig, 0, [recording]))


@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        (("pressure_states",), "the pressures of elbow_flexor and elbow_extensor are swapped"),
        (("valve_commands",), "the valve commands of elbow_flexor and elbow_extensor are swapped"),
        (("pressure_states", "valve_commands"), "the hoses of the muscles elbow_flexor and"),
    ],
)
def test_swapped_muscles_are_told(
    rig: Rig, record: Maker, kinds: tuple[str, ...], words: str
) -> None:
    (note,) = missing(rig, swapped(record(), *kinds))
    assert note.startswith("Wrong wiring")
    assert words in note


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ((POSITION,), "the sign of joint elbow is reversed"),
        ((f"valve_commands.{FLEXOR}",), "the sign of the valve command of elbow_flexor"),
        ((f"valve_commands.{EXTENSOR}",), "the sign of the valve command of elbow_extensor"),
        (
            (f"valve_commands.{FLEXOR}", f"valve_commands.{EXTENSOR}"),
            "the signs of both valve commands are reversed",
        ),
    ],
)
def test_reversed_signs_are_told(
    rig: Rig, record: Maker, channels: tuple[str, ...], words: str
) -> None:
    (note,) = missing(rig, turned(record(), *channels))
    assert words in note


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"coulomb_friction.torque": 3.0},
        {"agonist.leakage.conductance": 4e-10},
        {"position_offset.offset": 0.15},
        {"pulley_radius.scale": 0.6},
    ],
)
def test_a_strong_effect_is_no_wrong_wiring(
    rig: Rig, record: Maker, changes: dict[str, float]
) -> None:
    assert missing(rig, record(changes)) == ()


def test_without_commands_the_sign_of_the_joint_still_shows(rig: Rig, record: Maker) -> None:
    known = {k: v for k, v in record().values.items() if not k.startswith("valve_commands")}
    recording = replace(record(), values=known)
    assert missing(rig, recording) == ()
    (note,) = missing(rig, turned(recording, POSITION))
    assert "the sign of joint elbow is reversed" in note


def test_a_locked_joint_has_no_direction(rig: Rig, record: Maker) -> None:
    assert missing(rig, replace(turned(record(), POSITION), mounting=LOCKED)) == ()


def believed(rig: Rig, **numbers: float) -> Rig:
    """The rig with other numbers of its joint, as an owner with a data sheet writes it."""
    return replace(rig, joints=(replace(rig.joints[0], **numbers), *rig.joints[1:]))


WRONG_NUMBERS = {"inertia": 0.033, "pulley_radius": 0.022, "viscous_friction": 0.4}


@pytest.mark.parametrize("gravity", [4.9, 12.0, 0.0])
def test_a_reversed_sign_is_told_with_numbers_that_are_off_by_a_third(
    rig: Rig, record: Maker, gravity: float
) -> None:
    """Also where gravity moves the joint more than the muscles do."""
    recording = record({"joint.gravity_torque": gravity})
    owner = believed(rig, **WRONG_NUMBERS, gravity_torque=0.7 * gravity)
    assert missing(owner, recording) == ()
    (note,) = missing(owner, turned(recording, POSITION))
    assert "the sign of joint elbow is reversed" in note
    assert "have a phase of 1" in note
    assert "muscles: [elbow_extensor, elbow_flexor]" in note


def test_a_joint_that_falls_is_not_taken_for_a_reversed_one(rig: Rig, record: Maker) -> None:
    """Above its axis, a heavy arm must be held back, so that torque and angle are opposed."""
    problem = PredictionProblem(
        believed(rig, gravity_angle=np.pi, gravity_torque=30.0), 0, [turned(record(), POSITION)]
    )
    assert directions(problem).motion.direction == Direction.UNDECIDED


def test_two_sensors_in_one_muscle_are_told(rig: Rig, record: Maker) -> None:
    recording = record()
    pressures = dict(recording.values)
    random = np.random.default_rng(3)
    first = pressures[f"pressure_states.{FLEXOR}"]
    pressures[f"pressure_states.{EXTENSOR}"] = first + 150.0 * random.standard_normal(first.size)
    (note,) = missing(rig, replace(recording, values=pressures))
    assert "of elbow_flexor and elbow_extensor show the same pressure" in note


def test_unrelated_signals_have_no_direction() -> None:
    random = np.random.default_rng(1)
    pairs = [(random.standard_normal(4000), random.standard_normal(4000), 0.01)]
    assert cross_phase(pairs, 5.0, DEFAULT.recording).direction == Direction.UNDECIDED


@pytest.mark.parametrize(
    ("sign", "direction"), [(1.0, Direction.AGREES), (-1.0, Direction.OPPOSED)]
)
def test_the_phase_of_a_lagging_noisy_signal(sign: float, direction: Direction) -> None:
    random = np.random.default_rng(2)
    time = 0.01 * np.arange(4000)
    first = np.sin(0.8 * time) + 0.4 * np.sin(2.9 * time)
    second = sign * (np.sin(0.8 * time - 0.4) + 0.3 * np.sin(2.9 * time - 0.7))
    noisy = second + 0.3 * random.standard_normal(time.size) + 0.01 * time
    found = cross_phase([(first, noisy, 0.01)], 0.6, DEFAULT.recording)
    assert found.direction == direction
