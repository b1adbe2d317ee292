"""The still figures of the report, as data URLs.

Axes are in the units that people use (mrad, kPa). Only the stage that the verdict names is
coloured, so that no other one looks like the cause. Legends name what is drawn, and nothing else.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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


@dataclass(frozen=True)
class RankedCandidate:
    """Share of the gap that a candidate leaves on held-out data, with its 90 % interval."""

    effect: str
    weight: float
    remaining: float
    low: float
    high: float
    note: str = ""


@dataclass(frozen=True)
class StageBar:
    """RMS error over floor of a stage that is simulated from its measured inputs."""

    stage: str
    gap_over_floor: float | None
    note: str = ""


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg")
    plt.close(figure)
    text = buffer.getvalue()
    return "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode()


def draw_stages(stages: Sequence[StageBar], blamed: Collection[str]) -> str:
    """Draw the chain of stages, each with its gap over floor; only the blamed are coloured."""
    figure, axis = plt.subplots(figsize=(9.5, 1.9), layout="constrained")
    axis.set_xlim(0, len(STAGES) * 2.4)
    axis.set_ylim(0, 1.5)
    axis.axis("off")
    known = {s.stage: s for s in stages}
    for i, stage in enumerate(STAGES):
        x = 0.1 + 2.4 * i
        entry = known.get(stage)
        gap = entry.gap_over_floor if entry else None
        is_named = stage in blamed
        box = mpl.patches.FancyBboxPatch(
            (x, 0.3), 1.9, 0.9, boxstyle="round,pad=0.03",
            facecolor=GUILTY if is_named else NEUTRAL,
            edgecolor=NOMINAL if is_named else "0.4", linewidth=3 if is_named else 1,
        )  # fmt: skip
        axis.add_patch(box)
        figures = "not measured alone" if gap is None else f"{plain(gap, 2)} × noise"
        axis.text(x + 0.95, 0.95, stage, ha="center", va="center", weight="bold", fontsize=11)
        axis.text(x + 0.95, 0.68, STAGE_FLOW[stage], ha="center", va="center", fontsize=8)
        axis.text(x + 0.95, 0.43, figures, ha="center", va="center", fontsize=9)
        if i + 1 < len(STAGES):
            axis.annotate(
                "", (x + 2.36, 0.75), (x + 1.97, 0.75), arrowprops={"arrowstyle": "->", "lw": 1.5}
            )
    return _svg(figure)


def draw_ranking(ranking: Sequence[RankedCandidate], named: Sequence[str]) -> str:
    """Draw the share of the held-out gap that remains with each candidate, with intervals."""
    shown = list(ranking)[:14]
    figure, axis = plt.subplots(figsize=(9.5, 0.8 + 0.3 * len(shown)), layout="constrained")
    for row, entry in enumerate(shown):
        effects = {part.split(" (")[0] for part in entry.effect.split(" + ")}
        is_named = effects <= set(named)
        colour = IMPROVED if is_named else "0.45"
        low = max(entry.low, LEAST_REMAINING)
        axis.plot([low, max(entry.high, low)], [row, row], color=colour, lw=2)
        axis.plot(max(entry.remaining, LEAST_REMAINING), row, "o", color=colour, ms=6)
        axis.text(
            1.01, row, percent(max(entry.remaining, 0.0)), transform=axis.get_yaxis_transform(),
            va="center", fontsize=8,
        )  # fmt: skip
    axis.set_yticks(range(len(shown)), [spoken(c.effect) for c in shown])
    axis.set_ylim(len(shown) - 0.4, -0.6)
    axis.set_xscale("log")
    axis.axvline(1.0, color="0.7", lw=1)
    axis.set_xlabel(
        "share of the gap that remains on held-out data, with 90 % interval\n"
        "(1: the whole gap of the re-tuned rig file; above 1: worse than without the effect)"
    )
    _ticks(axis, log_ticks(*axis.get_xlim()))
    axis.grid(axis="x", color="0.9")
    return _svg(figure)


LEAST_REMAINING = 1e-3
"""Smallest share that the logarithmic axis of the ranking shows."""
MOST_TICKS = 9


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


def _ticks(axis: Axes, ticks: Sequence[float]) -> None:
    """Plain numbers at these places of the x axis alone, which reaches to the outermost of them."""
    low, high = axis.get_xlim()
    axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_xticks([], minor=True)
    axis.set_xlim(min(low, ticks[0]), max(high, ticks[-1]))


def draw_shrinkage(gap: Mapping[str, Mapping[str, Any]], answer: str = WITH_ANSWER) -> str:
    """Draw the error of each channel as written and with the answer, relative to its floor."""
    figure, axis = plt.subplots(figsize=(9.5, 1.0 + 0.55 * len(gap)), layout="constrained")
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
    axis.set_yticks(range(len(gap)), list(gap))
    axis.invert_yaxis()
    axis.set_xscale("symlog", linthresh=1.0)
    axis.margins(x=0.25)
    _ticks(axis, [0.0, *log_ticks(1.0, max(axis.get_xlim()[1], 1.0))])
    axis.set_xlabel("RMS error, noise included, over noise floor, on held-out data")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return _svg(figure)
