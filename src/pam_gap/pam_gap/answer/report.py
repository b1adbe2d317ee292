"""The diagnosis as one self-contained HTML page for people; diagnosis.json is for machines.

Text from a recording or a rig file is escaped (Jinja2 autoescape).
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

MEASURED, NOMINAL, IMPROVED = "0.25", "#d1495b", "#00798c"
STAGES = ("valve", "muscle", "joint", "sensing")
STAGE_FLOW = {
    "valve": "commands → pressures",
    "muscle": "pressures, length → force",
    "joint": "force → motion",
    "sensing": "true → measured",
}
MAX_POINTS = 4000
"""A longer trace is thinned for the picture; the extremes of each bin are kept."""


@dataclass(frozen=True)
class Trace:
    """One channel as measured and as predicted, at the same times."""

    channel: str
    unit: str
    time: Array
    measured: Array
    nominal: Array
    improved: Array | None = None
    held_out: tuple[tuple[float, float], ...] = ()
    """Time intervals [s] that were not used for fitting."""


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
class StageGap:
    """RMS error over floor of a stage that is simulated from its measured inputs."""

    stage: str
    gap_over_floor: float | None
    note: str = ""


@dataclass(frozen=True)
class ReportData:
    """Everything that the page shows."""

    title: str
    verdict_sentence: str
    diagnosis: Mapping[str, Any]
    """The content of diagnosis.json."""
    stages: Sequence[StageGap]
    regimes: Sequence[tuple[str, float]]
    """Regime of the motion, and its squared error relative to the average."""
    traces: Sequence[Trace]
    ranking: Sequence[RankedCandidate]
    horizons: Sequence[tuple[str, str, float, float, float, str]]
    """Horizon, channel, before, after, floor, unit."""
    repairs: Sequence[str]
    left_out: Sequence[str]
    improved_rig: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)


def thinned(time: Array, values: Array, points: int = MAX_POINTS) -> tuple[Array, Array]:
    """Keep the smallest and largest value of each bin, so that no peak is lost.

    Parameters
    ----------
    time, values : (n,) ndarray
        A trace.
    points : int
        Largest number of values that are kept.
    """
    if time.size <= points:
        return time, values
    bins = points // 2
    width = time.size // bins
    cut = values[: bins * width].reshape(bins, width)
    filled = np.where(np.isfinite(cut), cut, 0.0)
    picks = np.sort(np.stack([filled.argmin(axis=1), filled.argmax(axis=1)]), axis=0)
    index = (picks + np.arange(bins) * width).T.ravel()
    return time[index], values[index]


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg")
    plt.close(figure)
    text = buffer.getvalue()
    return "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode()


def _png(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    plt.close(figure)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def draw_trace(trace: Trace) -> str:
    """Draw a channel and, below it, its residuals; return the picture as a data URL."""
    figure, (upper, lower) = plt.subplots(
        2, 1, figsize=(9.5, 4.2), sharex=True, layout="constrained", height_ratios=(2, 1)
    )
    curves = [("measured", trace.measured, MEASURED), ("nominal", trace.nominal, NOMINAL)]
    if trace.improved is not None:
        curves.append(("improved", trace.improved, IMPROVED))
    for label, values, colour in curves:
        upper.plot(*thinned(trace.time, values), color=colour, lw=0.9, label=label)
        if label != "measured":
            left = thinned(trace.time, values - trace.measured)
            lower.plot(*left, color=colour, lw=0.7, label=f"{label} minus measured")
    for start, end in trace.held_out:
        for axis in (upper, lower):
            axis.axvspan(start, end, color="0.92", zorder=0)
    upper.set_ylabel(f"[{trace.unit}]")
    lower.set_ylabel(f"residual [{trace.unit}]")
    lower.set_xlabel("time [s]   (grey: not used for fitting)")
    upper.legend(loc="upper right", fontsize=8, ncols=3)
    upper.set_title(trace.channel, fontsize=10, loc="left")
    return _png(figure)


def draw_stages(stages: Sequence[StageGap], named: str | None) -> str:
    """Draw the chain of stages, each with its gap over floor; the named stage is marked."""
    figure, axis = plt.subplots(figsize=(9.5, 1.9), layout="constrained")
    axis.set_xlim(0, len(STAGES) * 2.4)
    axis.set_ylim(0, 1.5)
    axis.axis("off")
    known = {s.stage: s for s in stages}
    for i, stage in enumerate(STAGES):
        x = 0.1 + 2.4 * i
        entry = known.get(stage)
        gap = entry.gap_over_floor if entry else None
        colour = "#eeeeee" if gap is None else plt.get_cmap("YlOrRd")(min(0.75, 0.12 * gap))
        box = mpl.patches.FancyBboxPatch(
            (x, 0.3), 1.9, 0.9, boxstyle="round,pad=0.03", facecolor=colour,
            edgecolor=NOMINAL if stage == named else "0.4", linewidth=3 if stage == named else 1,
        )  # fmt: skip
        axis.add_patch(box)
        figures = "not measured" if gap is None else f"{gap:.1f} × floor"
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
    figure, axis = plt.subplots(figsize=(9.5, 0.6 + 0.3 * len(shown)), layout="constrained")
    for row, entry in enumerate(shown):
        colour = IMPROVED if entry.effect.split(" (")[0] in named else "0.5"
        axis.plot([entry.low, entry.high], [row, row], color=colour, lw=2, solid_capstyle="round")
        axis.plot(entry.remaining, row, "o", color=colour, ms=6)
    axis.set_yticks(range(len(shown)), [c.effect for c in shown])
    axis.set_ylim(len(shown) - 0.4, -0.6)
    axis.set_xscale("log")
    axis.axvline(1.0, color="0.7", lw=1)
    axis.set_xlabel(
        "share of the gap that remains on held-out data, with 90 % interval (1: the whole gap)"
    )
    axis.grid(axis="x", color="0.9")
    return _svg(figure)


def draw_shrinkage(gap: Mapping[str, Mapping[str, Any]]) -> str:
    """Draw the gap of each channel before and after the correction, relative to its floor."""
    figure, axis = plt.subplots(figsize=(9.5, 0.8 + 0.55 * len(gap)), layout="constrained")
    for row, entry in enumerate(gap.values()):
        floor = max(float(entry["floor"]), 1e-300)
        axis.barh(row - 0.18, entry["before"] / floor, height=0.34, color=NOMINAL)
        axis.barh(row + 0.18, entry["after"] / floor, height=0.34, color=IMPROVED)
        text = f" {entry['before']:.3g} → {entry['after']:.3g} {entry['unit']}"
        axis.text(entry["before"] / floor, row - 0.18, text, va="center", fontsize=8)
    axis.axvline(1.0, color="0.2", ls="--", lw=1)
    axis.set_yticks(range(len(gap)), list(gap))
    axis.invert_yaxis()
    axis.set_xscale("symlog", linthresh=1.0)
    axis.margins(x=0.25)
    axis.set_xlabel(
        "RMS error over noise floor (red: before, green: after; dashed line: noise alone)"
    )
    return _svg(figure)


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ d.title }}</title>
<style>
 body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
        color: #222; }
 .verdict { border-left: .5rem solid {{ colour }}; background: #f6f6f6; padding: 1rem 1.2rem;
            font-size: 1.25rem; }
 .verdict small { display: block; font-size: .95rem; color: #555; margin-top: .4rem; }
 h2 { margin-top: 2.2rem; border-bottom: 1px solid #ddd; }
 table { border-collapse: collapse; font-size: .92rem; } td, th { padding: .2rem .8rem .2rem 0;
 text-align: left; } td.n { text-align: right; font-variant-numeric: tabular-nums; }
 img { max-width: 100%; } code { background: #f2f2f2; padding: 0 .25rem; }
 .quiet { color: #666; }
</style></head><body>
<h1>{{ d.title }}</h1>
<div class="verdict">{{ d.verdict_sentence }}
{% if closed %}<small>{{ closed }}</small>{% endif %}</div>

<h2>Where the gap arises</h2>
<img alt="stages and their gaps" src="{{ stages }}">
{% for s in d.stages if s.note %}<p class="quiet">{{ s.stage }}: {{ s.note }}</p>{% endfor %}
{% if d.regimes %}<p>The gap is largest in these regimes of the motion:
{% for name, part in d.regimes %}{{ name }} ({{ '%.1f' % part }} times
the average squared error){{ ', ' if not loop.last }}{% endfor %}.</p>{% endif %}

{% if diagnosis.parameters %}<h2>What was found</h2>
<table><tr><th>effect</th><th>parameter</th><th>value</th><th>90 % interval</th><th>unit</th></tr>
{% for effect, parameters in diagnosis.parameters.items() %}
{% for name, p in parameters.items() %}
<tr><td>{{ effect }}</td><td>{{ name }}</td><td class="n">{{ '%.4g' % p.value }}</td>
<td>{{ '%.4g' % p.low }} … {{ '%.4g' % p.high }}</td><td>{{ p.unit }}</td></tr>
{% endfor %}{% endfor %}</table>{% endif %}

{% if ranking %}<h2>Which effect explains the gap</h2>
<img alt="ranking of candidates" src="{{ ranking }}">
{% endif %}
{% if diagnosis.indistinguishable %}
<p>This recording cannot distinguish:
{% for group in diagnosis.indistinguishable %}<br>{{ group | join(', ') }}{% endfor %}</p>
{% endif %}

{% if diagnosis.gap %}<h2>How far the gap closes</h2>
<img alt="gap before and after" src="{{ shrinkage }}">
{% endif %}
{% if d.horizons %}<table>
<tr><th>horizon</th><th>channel</th><th>before</th><th>after</th><th>floor</th><th>unit</th></tr>
{% for h, channel, before, after, floor, unit in d.horizons %}
<tr><td>{{ h }}</td><td>{{ channel }}</td><td class="n">{{ '%.3g' % before }}</td>
<td class="n">{{ '%.3g' % after }}</td><td class="n">{{ '%.3g' % floor }}</td>
<td>{{ unit }}</td></tr>
{% endfor %}</table>{% endif %}

<h2>Measured, nominal, improved</h2>
{% for picture in traces %}<img alt="trace" src="{{ picture }}">{% endfor %}

<h2>What to do next</h2>
<p>{{ diagnosis.next_experiment or 'This verdict needs no further experiment.' }}</p>
{% if d.improved_rig %}<p>The improved rig file is <code>{{ d.improved_rig }}</code>. Simulation,
model node and controller can read it in place of your rig file.</p>{% endif %}

<h2>The data</h2>
<ul>{% for r in d.repairs %}<li>{{ r }}</li>{% else %}<li>The recordings needed no repair.</li>
{% endfor %}{% for r in d.left_out %}<li>Not available: {{ r }}</li>{% endfor %}</ul>
<table>{% for key, value in d.facts.items() %}<tr><td>{{ key }}</td><td>{{ value }}</td></tr>
{% endfor %}</table>
</body></html>
"""

_COLOURS = {
    "named": IMPROVED,
    "ambiguous": "#edae49",
    "unknown": NOMINAL,
    "none": "#66a182",
    "not_identifiable": "0.6",
}


def _closed_sentence(closed: Mapping[str, float] | None) -> str:
    if not closed:
        return ""
    return (
        f"The improved rig file closes {100 * closed['value']:.0f} % of the gap on data that were "
        f"not used for the fit (90 % interval {100 * closed['low']:.0f} to "
        f"{100 * closed['high']:.0f} %)."
    )


def render(data: ReportData) -> str:
    """Return the page as text.

    Parameters
    ----------
    data : ReportData
        The content of the page.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    diagnosis = dict(data.diagnosis)
    colour = mpl.colors.to_hex(_COLOURS.get(str(diagnosis["verdict"]), "0.6"))
    named = list(diagnosis["effects"])
    return environment.from_string(_PAGE).render(
        d=data,
        diagnosis=diagnosis,
        colour=colour,
        closed=_closed_sentence(diagnosis.get("closed")) if named else "",
        stages=draw_stages(data.stages, diagnosis["stage"]),
        ranking=draw_ranking(data.ranking, named) if data.ranking else "",
        shrinkage=draw_shrinkage(diagnosis["gap"]) if diagnosis["gap"] else "",
        traces=[draw_trace(trace) for trace in data.traces],
    )


def write_report(data: ReportData, path: Path) -> None:
    """Write the page to `path`."""
    with mpl.rc_context({"svg.fonttype": "none", "font.size": 9}):
        path.write_text(render(data), encoding="utf-8")
