"""`pam gap import LOG --rig RIG --out OUT`: a log of any program, understood and shown.

Without a map it proposes one and, on a terminal, asks about every channel. It writes the map, a
page that shows what was understood, and the recording as a Parquet table with the channels of the
rig contract. Nothing is fitted.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pam_gap.diagnose_recordings import joints_to_diagnose, what_is_missing
from pam_gap.import_log.preview_page import Preview, conversion, render
from pam_gap.import_log.propose_map import Proposed, map_text, propose, wanted_channels
from pam_gap.recordings.bag_columns import read_bag_columns
from pam_gap.recordings.column_map import ColumnMap, load_column_map
from pam_gap.recordings.import_csv import is_table, read_columns
from pam_gap.recordings.import_recording import is_bag, read_raw
from pam_gap.recordings.recording import Array, RawRecording, Recording, RecordingError, resample
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig

MAP, PAGE, TABLE = "map.yaml", "preview.html", "recording.parquet"
Ask = Callable[[str], str]


def columns_of(path: Path) -> tuple[dict[str, Array], list[str]]:
    """Every column of numbers in a log, and remarks on what is missing of a damaged bag.

    Raises
    ------
    RecordingError
        When it cannot be read or has another format.
    """
    if is_bag(path):
        channels, damage = read_bag_columns(path)
        return {name: channel.value for name, channel in channels.items()}, damage
    if is_table(path):
        return read_columns(path), []
    raise RecordingError(
        f"{path}: not a log; expected a bag, or a CSV, Parquet, NPZ, MAT, HDF5 or JSON file"
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
        shown = "-" if offer is None else " ".join((offer.column, offer.unit)).strip()
        while True:
            answer = ask(f"{channel} [{shown}]: ").strip() or shown
            if answer == "-":
                break
            column = next(
                (c for c in sorted(columns, key=len, reverse=True)
                 if answer == c or answer.startswith(f"{c} ")), None,
            )  # fmt: skip
            if column is not None:
                kept.append(Proposed(channel, column, answer[len(column) :].strip()))
                break
            ask(f"no column {answer!r}; the log has {', '.join(columns)} (press Enter)")
    return kept


def _proposed_map(
    path: Path, columns: Mapping[str, Array], rig: Rig, out: Path, rate: float, ask: Ask | None
) -> Path:
    """Write the map that is proposed or confirmed; return its path."""
    bag = is_bag(path)
    proposed = propose(columns, rig, is_bag=bag)
    if ask is not None:
        proposed = ask_about(proposed, columns, rig, is_bag=bag, ask=ask)
    if rate:
        proposed = [one for one in proposed if one.channel != "time"]
    place = out / MAP
    place.write_text(map_text(proposed, rate), encoding="utf-8")
    if not bag and not rate and all(one.channel != "time" for one in proposed):
        raise RecordingError(
            f"{path}: no column looks like a time ({', '.join(list(columns)[:12])}); state --rate "
            f"[Hz], or name the column in {place} and give it with --map"
        )
    return place


def _problems(rig: Rig, recording: Recording | None) -> list[str]:
    if recording is None:
        return []
    try:
        joints_to_diagnose(rig, [recording])
    except PamError as error:
        return [str(error)]
    return []


def _missing(rig: Rig, recording: Recording | None) -> list[str]:
    if recording is None:
        return []
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

    Raises
    ------
    RecordingError
        When the log or the map cannot be read, or no column fits.
    """
    columns, damage = columns_of(path)
    out.mkdir(parents=True, exist_ok=True)
    used = map_path or _proposed_map(path, columns, rig, out, rate, ask)
    column_map: ColumnMap = load_column_map(used)
    raw: RawRecording | None = None
    recording: Recording | None = None
    problems: list[str] = []
    try:
        raw = read_raw(path, column_map)
        recording = resample(raw)
    except RecordingError as error:
        problems.append(str(error))
    problems += _problems(rig, recording)
    preview = Preview(
        path,
        _summary(columns),
        column_map,
        recording,
        problems,
        _missing(rig, recording),
        damage,
    )
    (out / PAGE).write_text(render(preview), encoding="utf-8")
    if recording is not None and not problems:
        table = {"time": recording.time} | {
            name: np.where(recording.valid[name], values, np.nan)
            for name, values in recording.values.items()
        }
        pd.DataFrame(table).to_parquet(out / TABLE, index=False)
    return preview


def run(given: Arguments) -> Outcome:
    """Import a log and say what was understood; the command of `pam_gap.__main__`."""
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and not given.json
    preview = import_log(
        given.log, load_rig(given.rig), given.out, map_path=given.map, rate=given.rate,
        ask=input if terminal and given.map is None else None,
    )  # fmt: skip
    for channel, entry in preview.column_map.channels.items():
        print(f"{channel}: {' + '.join(entry.columns)} {conversion(entry, channel)}".rstrip())
    for text in preview.damage:
        print(f"warning: {text}", file=sys.stderr)
    for text in preview.problems:
        print(f"refused: {text}")
    print(f"written: {given.out}")
    return Outcome(
        {
            "out": given.out,
            "channels": {c: e.columns for c, e in preview.column_map.channels.items()},
            "problems": list(preview.problems),
            "missing": list(preview.missing),
            "damage": list(preview.damage),
        },
        list(preview.problems),
    )
