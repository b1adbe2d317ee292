"""The still figures of the report, each for a desk and for a phone.

Axes are in the units that people use (mrad, kPa). Only the stage that the verdict names is
coloured, so that no other one looks like the cause. Legends name what is drawn, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from textwrap import wrap
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pam_gap.answer.plots_in_page import WIDE, is_narrow
from pam_gap.answer.traces import IMPROVED, NOMINAL, WITH_ANSWER, WRITTEN
from pam_gap.answer.user_units import percent, plain, spoken, told

GUILTY, NEUTRAL = "#fbd5c0", "#f4f4f4"
STAGES = ("valve", "muscle", "joint", "sensing")
STAGE_FLOW = {
    "valve": "commands → pressures",
    "muscle": "pressures, length → force",
    "joint": "force → motion",
    "sensing": "true → measured",
}


def _label(name: str, width: float) -> str:
    """A name in as many lines as a narrow figure needs beside its curves."""
    if not is_narrow(width):
        return name
    return name.replace(" + ", " +\n").replace(" (", "\n(").replace(".", ".\n")


def _figure(width: float, rows: float, per_row: float) -> tuple[Figure, Axes]:
    """A figure [in] with one axis, whose height grows with the lines of text in its rows."""
    figure = Figure(figsize=(width, 1.0 + per_row * rows), layout="constrained")
    return figure, figure.subplots()


def draw_stages(
    stages: Sequence[Mapping[str, Any]], blamed: Collection[str], width: float = WIDE
) -> Figure:
    """Draw the chain of stages, each with its gap over floor; only the blamed are coloured.

    They stand beside each other or, in a narrow figure, below each other.
    """
    across = not is_narrow(width)
    figure = Figure(figsize=(width, 1.9 if across else 5.4), layout="constrained")
    axis = figure.subplots()
    length = len(STAGES) * (2.4 if across else 1.5)
    axis.set_xlim(0, length if across else 2.1)
    axis.set_ylim(0 if across else -length + 1.5, 1.5)
    axis.axis("off")
    known = {s["stage"]: s["gap_over_floor"] for s in stages}
    for i, stage in enumerate(STAGES):
        x, y = (2.4 * i, 0.0) if across else (0.0, -1.5 * i)
        gap = known.get(stage)
        is_named = stage in blamed
        box = mpl.patches.FancyBboxPatch(
            (x + 0.1, y + 0.3), 1.9, 0.9, boxstyle="round,pad=0.03",
            facecolor=GUILTY if is_named else NEUTRAL,
            edgecolor=NOMINAL if is_named else "0.4", linewidth=3 if is_named else 1,
        )  # fmt: skip
        axis.add_patch(box)
        figures = "not measured alone" if gap is None else f"{plain(gap, 2)} × noise"
        for height, text, look in (
            (0.95, stage, {"weight": "bold", "fontsize": 11}),
            (0.68, STAGE_FLOW[stage], {"fontsize": 9}),
            (0.43, figures, {"fontsize": 9}),
        ):
            axis.text(x + 1.05, y + height, text, ha="center", va="center", **look)
        if i + 1 < len(STAGES):
            start, end = (
                ((x + 2.07, 0.75), (x + 2.46, 0.75))
                if across
                else ((1.05, y + 0.25), (1.05, y - 0.25))
            )
            axis.annotate("", end, start, arrowprops={"arrowstyle": "->", "lw": 1.5})
    return figure


def draw_ranking(
    ranking: Sequence[Mapping[str, Any]], named: Sequence[str], width: float = WIDE
) -> Figure:
    """Draw the share of the held-out gap that remains with each candidate, with intervals."""
    shown = list(ranking)[:14]
    labels = [_label(spoken(entry["label"]), width) for entry in shown]
    lines = max((label.count("\n") + 1 for label in labels), default=1)
    figure, axis = _figure(width, len(shown), 0.3 if lines == 1 else 0.16 * lines + 0.06)
    for row, entry in enumerate(shown):
        left = entry["remaining"]
        effects = {part.split(" (")[0] for part in entry["label"].split(" + ")}
        is_named = effects <= set(named)
        colour = IMPROVED if is_named else "0.45"
        low = max(left["low"], LEAST_REMAINING)
        axis.plot([low, max(left["high"], low)], [row, row], color=colour, lw=2)
        axis.plot(max(left["value"], LEAST_REMAINING), row, "o", color=colour, ms=6)
        axis.text(
            1.01, row, percent(max(left["value"], 0.0)), transform=axis.get_yaxis_transform(),
            va="center", fontsize=8,
        )  # fmt: skip
    axis.set_yticks(range(len(shown)), labels)
    axis.set_ylim(len(shown) - 0.4, -0.6)
    axis.set_xscale("log")
    axis.axvline(1.0, color="0.7", lw=1)
    words = (
        "share of the gap that remains on held-out data [%], with 90 % interval",
        "(100 %: the whole gap of the re-tuned rig file; above: worse than without the effect)",
    )
    _name_axis(figure, axis, width, words)
    _ticks(axis, log_ticks(*axis.get_xlim()), width, factor=100.0)
    axis.grid(axis="x", color="0.9")
    return figure


def _name_axis(figure: Figure, axis: Axes, width: float, words: Sequence[str]) -> None:
    """Name the x axis; in a narrow figure over its whole width, because labels take half of it."""
    if is_narrow(width):
        figure.supxlabel("\n".join(line for text in words for line in wrap(text, 58)), fontsize=8)
    else:
        axis.set_xlabel("\n".join(words))


LEAST_REMAINING = 1e-3
"""Smallest share that the logarithmic axis of the ranking shows."""
MOST_TICKS = 9
MOST_NARROW = 5
"""Numbers below an axis of a narrow figure, beside the first and the last one."""


def log_ticks(low: float, high: float) -> list[float]:
    """Round numbers for a logarithmic axis, at least two; the ends may lie outside of low to high.

    Parameters
    ----------
    low, high : float
        Ends of the axis, above 0.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    for steps in ((1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,)):
        round_ones = [step * 10.0**k for k in range(first, last + 1) for step in steps]
        inside = [tick for tick in round_ones if low <= tick <= high]
        if 2 <= len(inside) <= MOST_TICKS:
            return inside
    return inside if len(inside) > 1 else [10.0**first, 10.0 ** max(last, first + 1)]


def _ticks(axis: Axes, ticks: Sequence[float], width: float, factor: float = 1.0) -> None:
    """Plain numbers at these places of the x axis alone, which reaches to the outermost of them."""
    low, high = axis.get_xlim()
    every = -(-len(ticks) // MOST_NARROW) if is_narrow(width) else 1
    kept = ticks[(len(ticks) - 1) % every :: every]  # the last one among them
    ticks = kept if len(kept) > 1 else ticks
    axis.set_xticks(ticks, [f"{factor * tick:g}" for tick in ticks])
    axis.set_xticks([], minor=True)
    axis.set_xlim(min(low, ticks[0]), max(high, ticks[-1]))


def draw_shrinkage(
    gap: Mapping[str, Mapping[str, Any]], answer: str = WITH_ANSWER, width: float = WIDE
) -> Figure:
    """Draw the error of each channel as written and with the answer, relative to its floor."""
    figure, axis = _figure(width, len(gap), 0.55 if not is_narrow(width) else 0.7)
    for row, entry in enumerate(gap.values()):
        floor = max(float(entry["floor"]), 1e-300)
        for key, offset, colour in (("before", -0.18, NOMINAL), ("after", 0.18, IMPROVED)):
            ratio = entry[key] / floor
            axis.barh(
                row + offset, ratio, height=0.34, color=colour,
                label={"before": WRITTEN, "after": answer}[key] if row == 0 else None,
            )  # fmt: skip
            text = told(float(entry[key]), str(entry["unit"]))
            axis.annotate(
                text, (ratio, row + offset), (4, 0), textcoords="offset points", va="center",
                fontsize=8,
            )  # fmt: skip
    axis.axvline(1.0, color="0.2", ls="--", lw=1, label="noise alone")
    axis.set_yticks(range(len(gap)), [_label(channel, width) for channel in gap])
    axis.invert_yaxis()
    axis.set_xscale("symlog", linthresh=1.0)
    axis.margins(x=0.25 if not is_narrow(width) else 0.5)
    _ticks(axis, [0.0, *log_ticks(1.0, max(axis.get_xlim()[1], 1.0))], width)
    words = ("RMS error, noise included, over noise floor, on held-out data",)
    _name_axis(figure, axis, width, words)
    columns = 3 if not is_narrow(width) else 1
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper right", ncols=columns)
    return figure
