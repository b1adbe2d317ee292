"""`pam gap import LOG --rig RIG --out OUT`: a log of any program, understood and shown.

Without a map it proposes one and, on a terminal, asks about every channel. It writes the map, a
page that shows what was understood, and the recording as a Parquet table with the channels of the
rig contract. Nothing is fitted.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from pam_gap.diagnose_recordings import (
    prepared_subject,
    subjects_to_diagnose,
    what_is_missing,
)
from pam_gap.import_log.channel_score import wanted_channels
from pam_gap.import_log.column_name import with_another_unit
from pam_gap.import_log.doubts import doubts, left_out
from pam_gap.import_log.preview_page import Preview, conversion, render
from pam_gap.import_log.propose_map import Proposed, map_text, propose
from pam_gap.prediction.bench_joint import bench_muscles
from pam_gap.prediction.identifiable import what_is_missing as not_identifiable_for
from pam_gap.recordings.bag_columns import read_bag_columns
from pam_gap.recordings.belongs_to_rig import NO_JOINT
from pam_gap.recordings.column_map import ColumnMap, load_column_map
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.import_csv import is_table, read_columns
from pam_gap.recordings.import_recording import is_bag, read_raw
from pam_gap.recordings.recording import (
    MUSCLES,
    Array,
    Recording,
    RecordingError,
)
from pam_gap.recordings.resample import resample
from pam_gap.recordings.text_table import Table
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_model.rig.partial import load_partial_rig
from pam_ros.foreign_text import all_shown, shown

_MOST = 12
"""Repairs that the terminal shows; the page shows all."""
MAP, PAGE, TABLE = "map.yaml", "preview.html", "recording.parquet"
Ask = Callable[[str], str]


def columns_of(path: Path, names: Sequence[str] = ()) -> Table:
    """Every column of a log, and remarks on what could not be read.

    `names` are those of the columns of a table of text that has none.

    Raises
    ------
    RecordingError
        When it cannot be read or has another format.
    """
    if is_bag(path):
        channels, damage = read_bag_columns(path)
        return Table({name: channel.value for name, channel in channels.items()}, remarks=damage)
    if is_table(path):
        return read_columns(path, names=names)
    raise RecordingError(
        f"{path}: not a log; expected a bag, or a CSV, text, Parquet, NPZ, MAT, HDF5 or JSON file"
    )


def _summary(columns: Mapping[str, Array]) -> dict[str, tuple[int, float, float]]:
    found = {}
    for name, values in columns.items():
        finite = values[np.isfinite(values)]
        if finite.size:
            found[name] = (finite.size, float(finite.min()), float(finite.max()))
    return found


def ask_about(
    proposed: list[Proposed], columns: Mapping[str, Array], rig: Rig, *, is_bag: bool, ask: Ask
) -> list[Proposed]:
    """Ask about every channel: Enter keeps the proposal, `-` leaves the channel out.

    Parameters
    ----------
    proposed : list of Proposed
        What is offered.
    columns : mapping of str to ndarray
        The columns of the log.
    rig : Rig
        The rig that was recorded.
    is_bag : bool
        Whether no time is asked for.
    ask : callable
        Shows a text and returns the answer, such as `input`.
    """
    offers = {one.channel: one for one in proposed}
    kept: list[Proposed] = []
    for channel in ([] if is_bag else ["time"]) + wanted_channels(rig):
        offer = offers.get(channel)
        offered = "-" if offer is None else " ".join((offer.column, offer.unit)).strip()
        while True:
            answer = ask(f"{channel} [{offered}]: ").strip() or offered
            if answer == "-":
                break
            column = next(
                (c for c in sorted(columns, key=len, reverse=True)
                 if answer == c or answer.startswith(f"{c} ")), None,
            )  # fmt: skip
            if column is not None:
                kept.append(Proposed(channel, column, answer[len(column) :].strip()))
                break
            ask(f"no column {shown(answer)}; the log has {all_shown(columns)} (press Enter)")
    return kept


def _proposed_map(
    path: Path, table: Table, rig: Rig, out: Path, rate: float, ask: Ask | None
) -> tuple[Path, list[str]]:
    """Write the map that is proposed or confirmed; return its path, and what is doubtful in it."""
    bag, columns = is_bag(path), table.columns
    proposed = propose(columns, rig, is_bag=bag, units=table.units)
    doubtful = [] if bag else doubts(proposed, table, rig)
    if ask is not None:
        for text in doubtful:
            ask(f"check {text} (press Enter)")
        proposed = ask_about(proposed, columns, rig, is_bag=bag, ask=ask)
    if rate:
        proposed = [one for one in proposed if one.channel != "time"]
    place = out / MAP
    place.write_text(map_text(proposed, rate), encoding="utf-8")
    if all(one.channel == "time" for one in proposed):
        raise RecordingError(f"{path}: no column was mapped: {_why_none(table, rig, place)}")
    if not bag and not rate and all(one.channel != "time" for one in proposed):
        why = (
            f"{path}: no column looks like a time ({all_shown(columns)}){_of_text(table)}; state "
            f"--rate [Hz], or name the column in {place} and give it with --map"
        )
        others = [f"{path}: {text}" for text in left_out(proposed, table, rig)]
        raise RecordingError("\n".join([why, *others]))
    return place, [] if ask else doubtful


def _why_none(table: Table, rig: Rig, place: Path) -> str:
    """Why nothing is proposed, and what to do."""
    if not (rig.joints or bench_muscles(rig)):
        return NO_JOINT
    strange = with_another_unit(table.columns, table.units)
    of_unit = (
        f"; {all_shown(strange)}: in a unit that no channel has, or in steps of a converter, which "
        "the map can convert (`scale`, `offset`)"
        if strange
        else ""
    )
    return (
        f"none of {all_shown(table.columns) or 'its columns, of which there are none,'} looks like "
        f"a pressure, position or command of the rig file{_of_text(table)}{of_unit}; name the "
        f"columns in {place} and give it with --map"
    )


def _of_text(table: Table) -> str:
    """The columns without a number, each with its first entry."""
    texts = [f"column {shown(name)} holds {text}" for name, text in table.texts.items()
             if not np.isfinite(table.columns[name]).any()]  # fmt: skip
    return f"; {'; '.join(texts[:3])}" if texts else ""


def _no_verdict(rig: Rig, recording: Recording) -> list[str]:
    """Why a diagnosis of this recording alone ends in `not_identifiable`; nothing is fitted."""
    measured = without_computed(recording, rig)
    found: list[str] = []
    for name in subjects_to_diagnose(rig, [measured]):
        found += not_identifiable_for(prepared_subject(rig, name, [measured]).problem)
    return list(dict.fromkeys(found))


def _missing(rig: Rig, recording: Recording) -> list[str]:
    found = (n for j in range(len(rig.joints)) for n in what_is_missing(rig, j, recording))
    return list(dict.fromkeys(found))


def import_log(
    path: Path,
    rig: Rig,
    out: Path,
    *,
    map_path: Path | None = None,
    rate: float = 0.0,
    ask: Ask | None = None,
    is_rough: bool = False,
) -> Preview:
    """Read a log, and write map, preview and table to `out`.

    Parameters
    ----------
    path : Path
        A bag or a table.
    rig : Rig
        The rig that was recorded.
    out : Path
        Folder for the results.
    map_path : Path, optional
        Map of the columns; without it, one is proposed.
    rate : float
        Rate [Hz] of a table without a time, for the proposal.
    ask : callable, optional
        Asks about every channel of a proposal.
    is_rough : bool
        Whether numbers of the rig are guesses, so that no verdict can be judged yet.

    Raises
    ------
    RecordingError
        When the log or the map cannot be read, or no column fits.
    """
    given = None if map_path is None else load_column_map(map_path)
    table = columns_of(path, given.names if given else ())
    out.mkdir(parents=True, exist_ok=True)
    doubtful = list[str]()
    if given is None:
        proposed, doubtful = _proposed_map(path, table, rig, out, rate, ask)
        given = load_column_map(proposed)
    column_map: ColumnMap = given
    recording: Recording | None = None
    problems: list[str] = []
    missing: list[str] = []
    no_verdict: list[str] = []
    try:
        recording = resample(read_raw(path, column_map))
        missing = _missing(rig, recording)
        subjects_to_diagnose(rig, [recording])
    except PamError as error:
        of_text = "" if map_path or recording is None else _of_text(table)
        first, *others = str(error).splitlines()
        problems += [f"{first}{of_text}", *others]
    if recording is not None and not problems:
        if not is_rough:
            no_verdict = _no_verdict(rig, recording)
        values = {"time": recording.time} | {
            name: np.where(recording.valid[name], column, np.nan)
            for name, column in recording.values.items()
        }
        pd.DataFrame(values).to_parquet(out / TABLE, index=False)
    preview = Preview(
        path,
        _summary(table.columns),
        column_map,
        recording,
        problems,
        missing,
        table.remarks,
        no_verdict,
        doubtful,
    )
    (out / PAGE).write_text(render(preview), encoding="utf-8")
    return preview


def run(given: Arguments) -> Outcome:
    """Import a log and say what was understood; the command of `pam_gap.__main__`."""
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and not given.json
    partial = load_partial_rig(given.rig)
    rig = partial.rig if partial.is_rough else load_rig(given.rig)
    preview = import_log(
        given.log, rig, given.out, map_path=given.map, rate=given.rate,
        ask=input if terminal and given.map is None else None, is_rough=partial.is_rough,
    )  # fmt: skip
    for channel, entry in preview.column_map.channels.items():
        made_of = " + ".join(map(shown, entry.columns))
        print(f"{channel}: {f'{made_of} {conversion(entry, channel)}'.strip()}")
    if preview.unused:
        print(f"columns that are not used: {all_shown(preview.unused)}")
    for text in preview.missing:
        if not text.startswith(MUSCLES):  # few robots have load cells
            print(f"missing: {text}")
    for text in preview.recording.repairs[:_MOST] if preview.recording else ():
        print(f"note: {text}")
    for text in preview.doubts:
        print(f"check: {text}")
    for text in preview.damage:
        print(f"warning: {text}", file=sys.stderr)
    for text in preview.problems:
        print(f"refused: {text}")
    for text in preview.no_verdict:
        print(f"no verdict can follow: {text}")
    usable = preview.recording
    if usable is not None and not preview.problems and not preview.no_verdict:
        print(
            f"usable: {usable.duration:.3g} s at {1.0 / usable.sample_time:.4g} Hz, "
            f"{len(usable.values)} channels"
        )
    if partial.is_rough:
        print("note: the rig file is rough; find its numbers with `pam gap calibrate` and this map")
    print(f"written: {given.out}")
    return Outcome(
        {
            "out": given.out,
            "channels": {c: e.columns for c, e in preview.column_map.channels.items()},
            "problems": list(preview.problems),
            "missing": list(preview.missing),
            "doubts": list(preview.doubts),
            "damage": list(preview.damage),
            "no_verdict": list(preview.no_verdict),
        },
        [*preview.problems, *preview.no_verdict],
    )
