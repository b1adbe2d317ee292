"""What a person has to check of a proposed map, or to add to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pam_gap.import_log.channel_score import (
    expected_unit,
    kind_of,
    own_names,
    score_of_words,
    wanted_channels,
)
from pam_gap.import_log.column_name import ColumnName
from pam_gap.import_log.propose_map import Proposed
from pam_gap.prediction.bench_joint import bench_muscles
from pam_gap.recordings.recording import COMMANDS, JOINTS, MUSCLES, PRESSURES
from pam_gap.recordings.text_table import Table
from pam_model.rig import Rig
from pam_ros.foreign_text import all_shown, shown

_CONTRACTION: Final = frozenset(["contraction", "epsilon", "eps", "shortening"])
"""Words of how much shorter a muscle is, over its rest length."""


def doubts(proposed: Sequence[Proposed], table: Table, rig: Rig) -> list[str]:
    """What a person has to check of a proposal, or to add to it.

    Parameters
    ----------
    proposed : sequence of Proposed
        What was proposed.
    table : Table
        The columns of the log, with the text that is in them.
    rig : Rig
        The rig that was recorded.
    """
    found = [
        f"{one.channel}: {all_shown(one.alike)} fits as well as {shown(one.column)}"
        for one in proposed
        if one.alike
    ]
    guessed: dict[str, list[str]] = {}
    for one in proposed:
        if one.is_guessed and one.unit:
            guessed.setdefault(one.unit, []).append(one.column)
    found += [f"{all_shown(of)}: taken for {unit} by the size" for unit, of in guessed.items()]
    plain = [p.column for p in proposed if p.is_guessed and not p.unit and _needs_a_unit(p, rig)]
    if plain:
        found.append(f"{all_shown(plain)}: no unit is stated; taken for Pa")
    return found + left_out(proposed, table, rig)


def left_out(proposed: Sequence[Proposed], table: Table, rig: Rig) -> list[str]:
    """Why columns are not proposed although their words fit a channel that has none.

    Parameters and words are those of `doubts`.
    """
    found: list[str] = []
    used = {one.column for one in proposed}
    names = [
        ColumnName(name, table.units.get(name, ""), table.columns)
        for name in table.columns
        if name not in used
    ]
    there, benches = {one.channel for one in proposed}, bench_muscles(rig)
    places: dict[str, int] = {}
    for channel in wanted_channels(rig):
        kind = kind_of(channel)
        place = places[kind] = places.get(kind, 0) + 1
        muscle = channel.partition(".")[2].partition(".")[0]
        is_needed = channel.startswith((PRESSURES, COMMANDS, JOINTS)) or (
            channel.startswith(MUSCLES) and muscle in benches
        )
        if channel in there or not is_needed:
            continue
        scores = {name: score_of_words(channel, place, name, rig) for name in names}
        best = max(scores.values(), default=0.0)
        for name in (each for each, score in scores.items() if score == best > 0.0):
            reason = _why_left_out(channel, name, table, rig)
            if reason:
                found.append(f"{channel}: {shown(name.name)} looks like it, but {reason}")
        if kind == "length":
            rest = rig.muscle(muscle).rest_length
            found += [
                f"{channel}: {shown(name.name)} looks like a contraction; for a share of the rest "
                f"length, write `scale: -{rest:g}, offset: {rest:g}` (`scale: -{0.01 * rest:g}` "
                "for per cent)"
                for name in names
                if name.words & _CONTRACTION
            ]
    return found


def _needs_a_unit(one: Proposed, rig: Rig) -> bool:
    """Whether a column is a pressure under a name that is not one of this suite."""
    own = any(one.column.endswith(name) for name in own_names(one.channel))
    return not own and expected_unit(one.channel, rig).startswith("Pa")


def _why_left_out(channel: str, column: ColumnName, table: Table, rig: Rig) -> str:
    """Why a column with the right words is not proposed; empty if it is not known."""
    if not np.isfinite(table.columns[column.name]).any():
        text = table.texts.get(column.name)
        return f"holds {text}" if text else ""
    if column.is_of(expected_unit(channel, rig)):
        return ""
    return "has another unit; `scale` and `offset` of the map can convert it"
