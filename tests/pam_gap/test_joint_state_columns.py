"""Messages that are collected as tables give the same channels as messages read one by one."""

from __future__ import annotations

import math
import random
from collections import defaultdict

import numpy as np
import pytest

from pam_gap.recordings.joint_state_columns import JointStateColumns
from pam_ros.joint_state_bytes import JointStateFields

NAMES = ("a", "b", "c")


def drawn(seed: int) -> list[JointStateFields]:
    """Messages whose names, lengths and missing numbers change."""
    draw = random.Random(seed)

    def numbers(length: int) -> tuple[float, ...]:
        return tuple(draw.choice((math.nan, draw.random())) for _ in range(length))

    found = []
    for _ in range(60):
        names = tuple(draw.sample(NAMES, draw.randrange(4)))
        lengths = [draw.choice((len(names), len(names), 0, 2)) for _ in range(2)]
        found.append(
            JointStateFields(0, 0, "", names, numbers(lengths[0]), (), numbers(lengths[1]))
        )
    return found


def collected(messages: list[JointStateFields]) -> JointStateColumns:
    columns = JointStateColumns()
    for place, message in enumerate(messages):
        columns.add(-0.1 * place, message)  # the order of the bag counts, not that of the stamps
    return columns


@pytest.mark.parametrize("seed", range(20))
def test_commands_are_those_of_every_single_message(seed: int) -> None:
    expected: dict[str, list[tuple[float, float]]] = defaultdict(list)
    unclear: dict[str, int] = defaultdict(int)
    messages = drawn(seed)
    for place, message in enumerate(messages):
        fields = [f for f in (message.position, message.effort) if len(f) == len(message.name)]
        for k, muscle in enumerate(message.name):
            numbers = [field[k] for field in fields if math.isfinite(field[k])]
            if len(numbers) == 1:
                expected[f"command.{muscle}"].append((-0.1 * place, numbers[0]))
            elif numbers:  # no valve takes both
                unclear[muscle] += 1
    channels, ambiguous = collected(messages).commands("command.{}")
    assert ambiguous == unclear
    assert set(channels) == set(expected)
    for name, pairs in expected.items():
        found = np.column_stack((channels[name].time, channels[name].value))
        np.testing.assert_array_equal(found, pairs)


@pytest.mark.parametrize("seed", range(20))
def test_measurements_are_those_of_every_single_message(seed: int) -> None:
    expected: dict[str, list[tuple[float, float]]] = defaultdict(list)
    messages = drawn(seed)
    for place, message in enumerate(messages):
        for field in ("position", "effort"):
            values = getattr(message, field)
            if len(values) == len(message.name):
                for name, value in zip(message.name, values, strict=True):
                    if math.isfinite(value):
                        expected[f"{field}.{name}"].append((-0.1 * place, value))
    found = collected(messages).measured({"position": "position.{}", "effort": "effort.{}"})
    assert set(found) == set(expected)
    for name, pairs in expected.items():
        rows = np.column_stack((found[name].time, found[name].value))
        np.testing.assert_array_equal(rows, pairs)
