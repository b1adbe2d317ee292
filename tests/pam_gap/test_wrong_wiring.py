"""Channels that are swapped or reversed are told before a cause is sought for them."""

from dataclasses import replace

import pytest

from pam_gap.prediction.identifiable import what_is_missing
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, Recording
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
        (("pressure_states", "valve_commands"), "the muscles elbow_flexor and elbow_extensor are"),
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
