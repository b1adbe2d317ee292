"""Which commands are taken, as what, and how a refused one is counted and named."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pam_driver.safety.valve_command_intake import (
    CommandRefusedError,
    NamedCommand,
    ValveCommandIntake,
)
from pam_model.errors import PamError
from pam_model.rig import Rig

NAMES = ("elbow_flexor", "elbow_extensor")
GOOD = (0.25, -0.5)
NAN = math.nan
TIMEOUT = 0.125
FLOW = "elbow_flexor: a flow valve takes position (-1 to 1), and no other field"
REGULATOR = "elbow_flexor: a pressure regulator takes effort (Pa gauge), and no other field"


@pytest.fixture
def intake(rig: Rig) -> ValveCommandIntake:
    return ValveCommandIntake(rig, TIMEOUT)


@pytest.fixture
def regulated(rig: Rig) -> ValveCommandIntake:
    """The flexor's valve is a regulator whose full scale is beyond max_pressure."""
    flexor = rig.muscles[0]
    valve = replace(flexor.valve, kind="pressure_regulator", full_scale=800_000.0)
    return ValveCommandIntake(rig.with_muscle(replace(flexor, valve=valve)), TIMEOUT)


def refused(intake: ValveCommandIntake, command: NamedCommand, now: float = 8.0) -> tuple[str, str]:
    with pytest.raises(CommandRefusedError) as caught:
        intake.take(command, now)
    assert intake.last_rejection == str(caught.value)
    return caught.value.kind, str(caught.value)


BAD: dict[str, tuple[NamedCommand, tuple[str, str]]] = {
    "one name": (
        NamedCommand(NAMES[:1], (0.1,)),
        ("size", "1 names, expected 2: every muscle once"),
    ),
    "values": (NamedCommand(NAMES, (0.1,)), ("size", "1 values in position, expected 2")),
    "velocities": (
        NamedCommand(NAMES, GOOD, (0.1,)),
        ("size", "1 values in velocity, expected 2"),
    ),
    "efforts": (
        NamedCommand(NAMES, GOOD, (), (1.0, 1.0, 1.0)),
        ("size", "3 values in effort, expected 2"),
    ),
    "unknown": (
        NamedCommand(("k" * 100, NAMES[1]), GOOD),
        ("name", f"no muscle called '{'k' * 64}'... (100 characters)"),
    ),
    "twice": (NamedCommand(NAMES[:1] * 2, GOOD), ("name", "elbow_flexor is named twice")),
    "effort": (NamedCommand(NAMES, GOOD, (), (1.0, 1.0)), ("field", FLOW)),
    "effort for one": (NamedCommand(NAMES, GOOD, (), (1.0, NAN)), ("field", FLOW)),
    "velocity": (NamedCommand(NAMES, GOOD, (0.0, NAN)), ("field", FLOW)),
    "no field": (NamedCommand(NAMES), ("field", FLOW)),
    "only NaN efforts": (NamedCommand(NAMES, (), (), (NAN, NAN)), ("field", FLOW)),
    "NaN": (
        NamedCommand(NAMES, (0.1, NAN)),
        ("not_finite", "elbow_extensor: nan is not a finite number"),
    ),
    "too high": (
        NamedCommand(NAMES, (1.5, 0.0)),
        ("out_of_range", "elbow_flexor: 1.5 of full opening, expected -1 to 1 of full opening"),
    ),
    "too low": (
        NamedCommand(NAMES, (0.0, -1.5)),
        ("out_of_range", "elbow_extensor: -1.5 of full opening, expected -1 to 1 of full opening"),
    ),
    "old": (
        NamedCommand(NAMES, GOOD, age=0.25),
        ("old", "0.250 s old, command_timeout is 0.125 s"),
    ),
    "future": (NamedCommand(NAMES, GOOD, age=-0.25), ("stamp", "stamped 0.250 s in the future")),
    "NaN age": (NamedCommand(NAMES, GOOD, age=NAN), ("stamp", "stamped nan s in the future")),
}


@pytest.mark.parametrize("name", BAD)
def test_a_refused_command_is_counted_by_kind_and_named(
    name: str, intake: ValveCommandIntake
) -> None:
    command, expected = BAD[name]
    for _ in range(3):
        assert refused(intake, command) == expected
    assert intake.rejected == {expected[0]: 3}
    assert intake.accepted == 0
    # it must not have left anything behind
    assert intake.take(NamedCommand(NAMES, GOOD), 8.0) == GOOD


def test_taken_commands_are_counted(intake: ValveCommandIntake) -> None:
    for count in range(1, 4):
        intake.take(NamedCommand(NAMES, GOOD), 8.0)
        assert intake.accepted == count
    assert not intake.rejected
    assert intake.last_rejection == ""


def test_fields_that_no_muscle_uses_may_be_full_of_nan(intake: ValveCommandIntake) -> None:
    command = NamedCommand(NAMES, GOOD, (NAN, NAN), (NAN, NAN))
    assert intake.take(command, 8.0) == GOOD


@pytest.mark.parametrize("age", [TIMEOUT, -0.01, 0.0])
def test_the_limits_of_age_are_allowed(age: float, intake: ValveCommandIntake) -> None:
    assert intake.take(NamedCommand(NAMES, GOOD, age=age), 8.0) == GOOD


def test_commands_may_be_out_of_order_by_as_much_as_clocks_disagree(
    intake: ValveCommandIntake,
) -> None:
    intake.take(NamedCommand(NAMES, GOOD), 10.0)
    intake.take(NamedCommand(NAMES, GOOD), 10.0 - 0.01)
    intake.take(NamedCommand(NAMES, GOOD), 10.0)
    expected = ("out_of_order", "older than the previous command")
    assert refused(intake, NamedCommand(NAMES, GOOD, age=0.02), 10.0) == expected


def test_order_is_that_of_computing_not_of_arriving(intake: ValveCommandIntake) -> None:
    intake.take(NamedCommand(NAMES, GOOD, age=0.05), 10.0)
    intake.take(NamedCommand(NAMES, GOOD, age=0.05), 10.002)
    intake.take(NamedCommand(NAMES, GOOD), 10.003)
    kind, _ = refused(intake, NamedCommand(NAMES, GOOD, age=0.05), 10.004)
    assert kind == "out_of_order"


def test_rounding_beyond_the_ends_is_clipped_and_no_more(intake: ValveCommandIntake) -> None:
    ends = (1.0 + 1e-6, -1.0 - 1e-6)
    assert intake.take(NamedCommand(NAMES, ends), 8.0) == (1.0, -1.0)
    for beyond in ((1.0 + 2e-6, 0.0), (0.0, -1.0 - 2e-6)):
        assert refused(intake, NamedCommand(NAMES, beyond))[0] == "out_of_range"


def test_valves_of_both_kinds_in_one_command(regulated: ValveCommandIntake) -> None:
    command = NamedCommand(NAMES, (NAN, -0.5), (), (200_000.0, NAN))
    assert regulated.take(command, 8.0) == (0.25, -0.5)
    assert refused(regulated, NamedCommand(NAMES, GOOD)) == ("field", REGULATOR)


def test_a_regulator_goes_up_to_max_pressure_and_its_rounding(
    regulated: ValveCommandIntake,
) -> None:
    for pressure, fraction in ((600_000.5, 0.75), (600_000.0, 0.75), (-0.5, 0.0)):
        command = NamedCommand(NAMES, (NAN, 0.0), (), (pressure, NAN))
        assert regulated.take(command, 8.0) == (fraction, 0.0)
    expected = "elbow_flexor: 600001 Pa, expected 0 to 600000 Pa"
    command = NamedCommand(NAMES, (NAN, 0.0), (), (600_001.0, NAN))
    assert refused(regulated, command) == ("out_of_range", expected)


@pytest.mark.parametrize("full_scale", [None, 0.0, -1.0, NAN])
def test_a_regulator_without_full_scale_is_refused_at_once(
    full_scale: float | None, rig: Rig
) -> None:
    flexor = rig.muscles[0]
    valve = replace(flexor.valve, kind="pressure_regulator")
    object.__setattr__(valve, "full_scale", full_scale)
    with pytest.raises(PamError) as caught:
        ValveCommandIntake(rig.with_muscle(replace(flexor, valve=valve)), TIMEOUT)
    expected = "elbow_flexor.valve.full_scale: a pressure regulator needs it [Pa gauge]"
    assert str(caught.value) == expected


def test_a_full_scale_below_max_pressure_is_the_limit(rig: Rig) -> None:
    flexor = rig.muscles[0]
    valve = replace(flexor.valve, kind="pressure_regulator", full_scale=1e4)
    intake = ValveCommandIntake(rig.with_muscle(replace(flexor, valve=valve)), TIMEOUT)
    assert intake.take(NamedCommand(NAMES, (NAN, 0.0), (), (1e4, NAN)), 8.0) == (1.0, 0.0)
    command = NamedCommand(NAMES, (NAN, 0.0), (), (1.5e4, NAN))
    assert refused(intake, command)[1] == "elbow_flexor: 15000 Pa, expected 0 to 10000 Pa"


def test_commands_go_back_into_their_units(
    intake: ValveCommandIntake, regulated: ValveCommandIntake, rig: Rig
) -> None:
    assert intake.in_units((0.25, -0.5)) == ([0.25, -0.5], [])
    position, effort = regulated.in_units((0.25, -0.5))
    assert (math.isnan(position[0]), position[1]) == (True, -0.5)
    assert (effort[0], math.isnan(effort[1])) == (200_000.0, True)
    muscles = [
        replace(m, valve=replace(m.valve, kind="pressure_regulator", full_scale=4e5))
        for m in rig.muscles
    ]
    both = ValveCommandIntake(replace(rig, muscles=tuple(muscles)), TIMEOUT)
    assert both.in_units((0.25, 0.5)) == ([], [1e5, 2e5])


def heard(intake: ValveCommandIntake, sources: list[str], period: float = 0.002) -> list[float]:
    """The times at which two publishers are reported [s]."""
    found = []
    for number, source in enumerate(sources):
        now = 8.0 + number * period
        intake.hear(source, now)
        if list(intake.conditions(now)):
            found.append(now)
    return found


def test_two_publishers_are_recognised_at_the_third_command(intake: ValveCommandIntake) -> None:
    assert heard(intake, ["a", "b", "a"]) == [pytest.approx(8.004)]
    (found,) = intake.conditions(8.01)
    assert (found.kind, found.subject) == ("two_publishers", "valve_commands")
    assert found.text == "two nodes publish commands, a and b: stop one of them"
    assert list(intake.conditions(8.9)) and not list(intake.conditions(9.1))


def test_a_publisher_without_a_name_is_recognised_beside_one_with_a_name(
    intake: ValveCommandIntake,
) -> None:
    assert heard(intake, ["", "b", ""])
    assert "one without a name and b" in next(intake.conditions(8.01)).text


@pytest.mark.parametrize("sources", [["a"] * 50, ["a"] * 5 + ["b"] * 50, [""] * 20 + ["b"] * 20])
def test_one_publisher_or_one_that_is_started_again_is_no_fault(
    intake: ValveCommandIntake, sources: list[str]
) -> None:
    assert not heard(intake, sources)


def test_publishers_that_take_turns_slowly_are_two_acts(intake: ValveCommandIntake) -> None:
    assert not heard(intake, ["a", "b", "a"], period=1.2)
