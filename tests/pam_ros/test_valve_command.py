"""Where a valve's command stands in a message: flow valves, pressure regulators, and both."""

import math
import subprocess
import sys
from array import array

import pytest

from pam_ros.valve_command import (
    FLOW,
    PRESSURE_REGULATOR,
    ValveCommandError,
    ValveCommandFormat,
)

NAN = math.nan
MIXED = ValveCommandFormat({"a": FLOW, "b": PRESSURE_REGULATOR})
SPOOLS = ValveCommandFormat({"a": FLOW, "b": FLOW})
REGULATORS = ValveCommandFormat({"a": PRESSURE_REGULATOR, "b": PRESSURE_REGULATOR})


def test_a_mixed_rig_fills_both_fields_with_nan_where_the_other_one_holds() -> None:
    position, effort = MIXED.pack((0.25, 2e5))
    assert position == pytest.approx([0.25, NAN], nan_ok=True)
    assert effort == pytest.approx([NAN, 2e5], nan_ok=True)


def test_a_field_that_no_muscle_uses_is_empty() -> None:
    assert SPOOLS.pack((0.25, -0.5)) == ([0.25, -0.5], [])
    assert REGULATORS.pack((1e5, 2e5)) == ([], [1e5, 2e5])


@pytest.mark.parametrize(
    ("form", "commands"),
    [(MIXED, [0.25, 2e5]), (SPOOLS, [0.25, -0.5]), (REGULATORS, [1e5, 2e5])],
)
def test_what_is_packed_is_unpacked_in_any_order_of_names(
    form: ValveCommandFormat, commands: list[float]
) -> None:
    position, effort = form.pack(commands)
    assert form.unpack(form.names, position, [], effort) == commands
    assert form.known(form.names, position, effort) == dict(zip("ab", commands, strict=True))
    # as a ROS message has its numbers, with all fields full, the muscles the other way round
    fields = [array("d", (field or [NAN, NAN])[::-1]) for field in (position, [], effort)]
    assert form.unpack(["b", "a"], *fields) == commands


def test_the_vented_command_is_that_of_the_kind_of_valve() -> None:
    assert MIXED.vented == (-1.0, 0.0)


WRONG = {
    "too few names": (["a"], [0.1], [], [], "size", "1 names, expected 2: every muscle once"),
    "short field": (["a", "b"], [0.1], [], [NAN, 1.0], "size", "1 values in position, expected 2"),
    "unknown": (["a", "c"], [0.1, NAN], [], [NAN, 1.0], "name", "no muscle called 'c'"),
    "twice": (["a", "a"], [0.1, 0.1], [], [NAN, NAN], "name", "a is named twice"),
    "twice, NaN": (["a", "a"], [NAN, NAN], [], [NAN, NAN], "name", "a is named twice"),
    "a spool for a regulator": (["a", "b"], [0.1, 0.0], [], [NAN, 1.0], "field", "b: a pressure"),
    "a pressure for a spool": (["a", "b"], [0.1, NAN], [], [0.0, 1.0], "field", "a: a flow valve"),
    "velocity": (["a", "b"], [0.1, NAN], [0.0, NAN], [NAN, 1.0], "field", "a: a flow valve"),
    "no effort": (["a", "b"], [0.1, NAN], [], [], "field", "b: a pressure regulator takes effort"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_message_that_is_no_command_for_the_rig_is_refused(case: str) -> None:
    names, position, velocity, effort, kind, text = WRONG[case]
    with pytest.raises(ValveCommandError) as caught:
        MIXED.unpack(names, position, velocity, effort)
    assert caught.value.kind == kind
    assert text in str(caught.value)


def test_a_listener_takes_of_a_message_what_it_can() -> None:
    assert MIXED.known(["stranger", "b"], [1.0, NAN], [NAN, 2e5]) == {"b": 2e5}
    assert MIXED.known(["a", "b"], [0.5, 0.0], []) == {"a": 0.5}
    assert MIXED.known(["a", "b"], [math.inf, 0.0], [0.0, NAN]) == {}


def test_an_unknown_kind_of_valve_is_refused() -> None:
    with pytest.raises(ValueError, match="b: 'servo' is not a kind of valve; expected flow or pre"):
        ValveCommandFormat({"a": FLOW, "b": "servo"})


def test_a_tool_without_ros_can_read_valve_commands() -> None:
    lines = "import sys, pam_ros.valve_command; print([m for m in sys.modules if 'rcl' in m])"
    run = subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
