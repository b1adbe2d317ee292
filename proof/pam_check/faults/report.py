"""The results of the campaign: a table, numbers for programs, and a picture of the times."""

from __future__ import annotations

import html
import json
import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from pam_check.fault_kinds.fault_kind import STOPS, FaultKind, Reaction
from pam_check.faults.trial import Trial

HEADINGS = (
    "fault", "layer", "trials", "noticed by", "reaction", "safe after, median [ms]",
    "worst [ms]", "bound [ms]", "empty after, median [s]", "worst [s]", "way [rad]", "thrown [rad]",
    "peak speed [rad/s]", "peak force [N]", "peak pressure [kPa]", "peak angle error [rad]",
    "verdict",
)  # fmt: skip


def rows(kinds: Sequence[FaultKind], trials: Sequence[Trial]) -> list[tuple[str, ...]]:
    """One row for each kind with trials."""
    table: list[tuple[str, ...]] = []
    for kind in kinds:
        mine = [trial for trial in trials if trial.kind == kind.name]
        if not mine:
            continue
        by = Counter(name for trial in mine for name in trial.noticed if name in kind.detected_by)
        named = ", ".join(name for name, _ in by.most_common(2))
        times = [1e3 * after for trial in mine if (after := _bounded_time(kind, trial)) is not None]
        empty = [trial.empty_after for trial in mine if trial.empty_after is not None]
        vents = kind.reaction in STOPS
        bad = [trial.problem for trial in mine if trial.problem]
        table.append(
            (
                kind.name,
                kind.layer,
                str(len(mine)),
                named or f"nobody: {kind.reason}",
                f"{kind.reaction.value}; {len(times)} vented"
                if kind.reaction in {Reaction.EITHER, Reaction.NOTICED}
                else kind.reaction.value,
                f"{statistics.median(times):.0f}" if times else "",
                f"{max(times):.0f}" if times else "",
                f"{1e3 * kind.bound:.0f}" if vents else "",
                f"{statistics.median(empty):.2f}" if vents and empty else "",
                f"{max(empty):.2f}" if vents and len(empty) == len(mine) else "",
                f"{max(trial.way for trial in mine):.2f}" if vents else "",
                f"{max(trial.thrown for trial in mine):.2f}" if vents else "",
                f"{max(trial.peak_speed for trial in mine):.1f}",
                f"{max(trial.peak_force for trial in mine):.0f}",
                f"{1e-3 * max(trial.peak_pressure for trial in mine):.0f}",
                f"{max(trial.peak_error for trial in mine):.3f}",
                f"{len(bad)} of {len(mine)} fail: {bad[0]}" if bad else "kept",
            )
        )
    return table


def _bounded_time(kind: FaultKind, trial: Trial) -> float | None:
    """The time [s] to which the kind's bound applies."""
    return trial.stopped_after if kind.bounds_driver else trial.safe_after


def summarised(table: Sequence[tuple[str, ...]], trials: Sequence[Trial]) -> str:
    """Summary of all trials in one line."""
    failed = sum(bool(trial.problem) for trial in trials)
    return f"{len(trials)} injections of {len(table)} kinds, {failed} out of bounds"


def as_markdown(kinds: Sequence[FaultKind], trials: Sequence[Trial], command: str = "") -> str:
    """The table as a page, with the command that made it, if it is given."""
    table = rows(kinds, trials)
    lines = ["# Faults injected", "", f"{summarised(table, trials)}."]
    if command:
        lines += [
            "[faults.md](faults.md) explains the columns. This command makes the table:",
            "",
            f"    {command}",
        ]
    lines += ["", "| " + " | ".join(HEADINGS) + " |", "|---" * len(HEADINGS) + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in table]
    said = {trial.kind: trial.message for trial in trials if trial.message}
    if said:
        lines += ["", "What the driver said, in one trial of each kind:", ""]
        lines += [f"- `{kind}`: {message}" for kind, message in said.items()]
    return "\n".join(lines) + "\n"


def write_report(kinds: Sequence[FaultKind], trials: Sequence[Trial], folder: Path) -> Path:
    """Write faults.md, faults.json, faults.png and faults.html; returns the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    table = rows(kinds, trials)
    summary = summarised(table, trials)
    (folder / "faults.md").write_text(as_markdown(kinds, trials), encoding="utf-8")
    (folder / "faults.json").write_text(
        json.dumps([asdict(trial) for trial in trials], indent=1), encoding="utf-8"
    )
    _draw(kinds, trials, folder / "faults.png")
    cells = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>\n"
        for row in table
    )
    heads = "".join(f"<th>{html.escape(head)}</th>" for head in HEADINGS)
    page = folder / "faults.html"
    page.write_text(
        "<!doctype html><meta charset='utf-8'><title>Faults injected</title>"
        "<style>body{font:14px sans-serif;margin:2em}td,th{padding:.2em .6em;text-align:left;"
        "border-bottom:1px solid #ccc}img{max-width:100%}</style>"
        f"<h1>Faults injected</h1><p>{html.escape(summary)}.</p><img src='faults.png' "
        f"alt='time to vented valves by fault'><table><tr>{heads}</tr>\n{cells}</table>\n",
        encoding="utf-8",
    )
    return page


def _draw(kinds: Sequence[FaultKind], trials: Sequence[Trial], path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  (slow to import)
    from matplotlib.figure import Figure  # noqa: PLC0415

    shown = [kind for kind in kinds if kind.reaction in STOPS]
    figure = Figure(figsize=(8.0, 1.5 + 0.2 * len(shown)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for place, kind in enumerate(shown):
        times = [
            max(1e3 * after, 0.5)
            for trial in trials
            if trial.kind == kind.name and (after := _bounded_time(kind, trial)) is not None
        ]
        axes.plot(times, [place] * len(times), "o", color="tab:blue", alpha=0.5, markersize=4)
        axes.plot(1e3 * kind.bound, place, "|", color="tab:red", markersize=10)
    axes.set_xscale("log")
    axes.set_yticks(range(len(shown)), [kind.name for kind in shown], fontsize=7)
    axes.set_ylim(len(shown), -1)
    axes.set_xlabel("time from the fault to vented valves [ms]; red: bound")
    axes.grid(axis="x", alpha=0.3)
    figure.savefig(path, dpi=110)
