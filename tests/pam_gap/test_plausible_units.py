"""Recordings in other units are refused at once: what, where, which value, how to convert."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.diagnose_recordings import joints_to_diagnose
from pam_gap.recordings.recording import SHUT, Recording, RecordingError
from pam_model.rig import Rig

from .conftest import Maker

STEP = 0.004
TIME = np.arange(0.0, 8.0, STEP)
FLEXOR, EXTENSOR = "elbow_flexor", "elbow_extensor"
RIGHT = {
    f"valve_commands.{FLEXOR}": 0.4 * np.sin(TIME),
    f"valve_commands.{EXTENSOR}": -0.4 * np.sin(TIME),
    f"pressure_states.{FLEXOR}": 2e5 + 5e4 * np.sin(TIME),
    f"pressure_states.{EXTENSOR}": 2e5 - 5e4 * np.sin(TIME),
    "joint_states.elbow.position": 0.2 * np.sin(TIME),
    f"muscle_states.{FLEXOR}.effort": 200.0 + 100.0 * np.sin(TIME),
    f"muscle_states.{FLEXOR}.position": 0.225 - 0.006 * np.sin(TIME),
    "supply_pressure": 7e5 + 1e3 * np.sin(TIME),
}


def made(changes: dict[str, np.ndarray] | None = None, step: float = STEP) -> Recording:
    values = {**RIGHT, **(changes or {})}
    valid = {name: np.ones(TIME.size, dtype=np.bool_) for name in values}
    return Recording(Path("log.csv"), step, TIME * step / STEP, values, valid, ())


def scaled(prefix: str, factor: float, offset: float = 0.0) -> dict[str, np.ndarray]:
    return {n: v * factor + offset for n, v in RIGHT.items() if n.startswith(prefix)}


def regulated(rig: Rig) -> Rig:
    for muscle in rig.muscles:
        rig = rig.with_muscle(
            replace(muscle, valve=replace(muscle.valve, kind="pressure_regulator"))
        )
    return rig


@pytest.mark.parametrize(
    ("recording", "told"),
    [
        (made(scaled("pressure_states", 1e-5)),
         ("pressure_states.elbow_flexor", "2.5", "Pa gauge", "bar (multiply by 100000)")),
        (made(scaled("pressure_states", 1e-3)), ("250", "kPa (multiply by 1000)")),
        (made(scaled("pressure_states", 1e-6)), ("0.25", "MPa (multiply by 1000000)")),
        (made(scaled("pressure_states", 1.0 / 6894.757)), ("36.26", "psi (multiply by 6894.757)")),
        (made(scaled("pressure_states", 1e-2)), ("2500", "mbar (multiply by 100)")),
        (made(scaled("pressure_states", 2.0, 1.5e5)),
         ("reaches 6.5e+05", "never falls below", "absolute (subtract 101325)")),
        (made(scaled("supply_pressure", 1e-5)), ("supply_pressure", "bar")),
        (made(scaled("joint_states", 180.0 / np.pi)),
         ("joint_states.elbow.position", "11.46", "rad", "deg (multiply by 0.01745329)")),
        (made(scaled("joint_states", 1e3)), ("200", "mrad (multiply by 0.001)")),
        (made({"joint_states.elbow.position": RIGHT["joint_states.elbow.position"] % (2 * np.pi)}),
         ("reaches 6.2", "jumps by 2 pi")),
        (made(scaled(f"muscle_states.{FLEXOR}.position", 1e3)), ("231", "mm (multiply by 0.001)")),
        (made(scaled(f"muscle_states.{FLEXOR}.effort", 1e3)), ("3e+05", "mN")),
        (made(scaled("valve_commands", 100.0)), ("40", "per cent (multiply by 0.01)")),
        (made(scaled("valve_commands", 1e5)), ("4e+04", "regulator", "flow valve")),
        (made(step=4.0), ("time advances by 4", "seconds", "ms (multiply by 0.001)")),
        (made(step=4e6), ("time advances by 4e+06", "ns")),
    ],
)  # fmt: skip
def test_other_units_are_refused_with_value_and_conversion(
    rig: Rig, recording: Recording, told: tuple[str, ...]
) -> None:
    """They ran for minutes and gave an answer."""
    with pytest.raises(RecordingError) as error:
        joints_to_diagnose(rig, [recording])
    for text in ("log.csv: ", *told):
        assert text in str(error.value)


@pytest.mark.parametrize(
    ("factor", "hint"), [(1e-5, "bar"), (1e-3, "kPa"), (1.0 / 6894.757, "psi"), (-1.0, "sign")]
)
def test_one_of_two_pressures_in_another_unit_or_with_the_wrong_sign_is_refused(
    rig: Rig, factor: float, hint: str
) -> None:
    noise = np.random.default_rng(3).normal(0.0, 200.0, TIME.size)
    name = f"pressure_states.{EXTENSOR}"
    with pytest.raises(RecordingError, match=hint) as refused:
        joints_to_diagnose(rig, [made({name: factor * (RIGHT[name] + noise)})])
    assert name in str(refused.value)


@pytest.mark.parametrize("zero", [0.0, 300.0, -300.0])
def test_a_muscle_that_is_never_filled_is_no_other_unit(rig: Rig, zero: float) -> None:
    noise = np.random.default_rng(3).normal(0.0, 60.0, TIME.size)
    empty = {f"pressure_states.{EXTENSOR}": zero + noise + 100.0 * np.sin(TIME) ** 8}
    assert joints_to_diagnose(rig, [made(empty)]) == [0]


def test_absolute_pressures_are_recognised_by_an_emptied_muscle(rig: Rig) -> None:
    filled = np.where(TIME < 4.0, 2e5, 2e5 * np.exp(-(TIME - 4.0) / 0.1))
    command = {f"valve_commands.{FLEXOR}": np.where(TIME < 4.0, 0.0, -0.6)}
    gauge = command | {f"pressure_states.{FLEXOR}": filled}
    absolute = command | {f"pressure_states.{FLEXOR}": filled + 101325.0}
    assert joints_to_diagnose(rig, [made(gauge)]) == [0]
    with pytest.raises(RecordingError, match=r"elbow_flexor stays at 1\.013e\+05.*subtract 101325"):
        joints_to_diagnose(rig, [made(absolute)])


def test_absolute_pressures_are_recognised_by_the_commands_of_a_regulator(rig: Rig) -> None:
    asked = {
        f"valve_commands.{m}": RIGHT[f"pressure_states.{m}"] + 500.0 for m in (FLEXOR, EXTENSOR)
    }
    assert joints_to_diagnose(regulated(rig), [made(asked)]) == [0]
    with pytest.raises(RecordingError, match=r"above its command throughout.*subtract 101325"):
        joints_to_diagnose(regulated(rig), [made(asked | scaled("pressure_states", 1.0, 101325.0))])


def test_commands_of_a_regulator_in_bar_are_refused(rig: Rig) -> None:
    asked = {
        f"valve_commands.{m}": 1e-5 * RIGHT[f"pressure_states.{m}"] for m in (FLEXOR, EXTENSOR)
    }
    with pytest.raises(RecordingError, match=r"stays within 2\.5.*bar \(multiply by 100000\)"):
        joints_to_diagnose(regulated(rig), [made(asked)])


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {f"pressure_states.{FLEXOR}": np.full(TIME.size, 40.0)},  # one muscle stays empty
        scaled("pressure_states", 1.0, 101325.0 - 1.5e5) | scaled("valve_commands", 0.1),
        scaled("joint_states", 5.0),
        {f"muscle_states.{FLEXOR}.effort": np.full(TIME.size, 0.2)},
    ],
)
def test_unusual_sizes_that_a_rig_can_have_are_let_in(
    rig: Rig, changes: dict[str, np.ndarray]
) -> None:
    assert joints_to_diagnose(rig, [made(changes)]) == [0]


def test_shut_muscles_may_exceed_the_supply_a_little(rig: Rig) -> None:
    pushed = made(scaled("pressure_states", 2.0, 1.5e5))
    assert joints_to_diagnose(rig, [replace(pushed, mounting=SHUT)]) == [0]


def test_a_vented_robot_is_not_one_that_measures_in_kilopascals(rig: Rig) -> None:
    noise = 150.0 * np.random.default_rng(1).standard_normal(TIME.size)
    empty = {name: noise for name in RIGHT if name.startswith("pressure_states")}
    with pytest.raises(RecordingError, match="noise about zero: record while the muscles hold"):
        joints_to_diagnose(rig, [made(empty)])


@pytest.mark.parametrize(
    ("factor", "offset", "told"),
    [
        (1.0, np.pi, "a zero that is off by 180 deg (subtract 3.1416 rad)"),
        (1.0, -0.5 * np.pi, "a zero that is off by -90 deg (add 1.5708 rad)"),
        (1.0, 4.0, "a zero that is off by about 4 rad"),
        (-1.0, np.pi, "counts the other way (multiply by -1), and a zero that is off by 180 deg"),
        (180.0 / np.pi, 180.0, "deg (multiply by 0.01745329), and a zero that is off by 180 deg"),
        (-180.0 / np.pi, 0.0, "deg (multiply by 0.01745329), and an encoder that counts the other"),
        (1e3, 0.0, "mrad (multiply by 0.001)"),
    ],
)
def test_a_position_is_compared_with_where_the_pressures_hold_the_joint(
    rig: Rig, record: Maker, factor: float, offset: float, told: str
) -> None:
    """By its size alone, half a turn looked like degrees or mrad."""
    name = "joint_states.elbow.position"
    recording = record()
    joints_to_diagnose(rig, [recording])
    values = {**recording.values, name: factor * recording.values[name] + offset}
    with pytest.raises(RecordingError) as raised:
        joints_to_diagnose(rig, [replace(recording, values=values)])
    assert told in str(raised.value)
    assert name in str(raised.value)
    assert ("mrad" in str(raised.value)) == ("mrad" in told)


def test_an_offset_that_the_diagnosis_can_name_is_not_refused(rig: Rig, record: Maker) -> None:
    joints_to_diagnose(rig, [record({"position_offset.offset": 0.5})])
