"""The page of a fleet: what changed, what needs repair next, every recording and its verdict."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.dates as mdates
import numpy as np
from matplotlib.figure import Figure

from pam_gap.answer.html_page import html_page, marked_up
from pam_gap.answer.page_style import VERDICT_WORDS
from pam_gap.answer.plots_in_page import is_narrow, picture
from pam_gap.answer.user_units import spoken, told, user_unit
from pam_gap.fleet.change_points import SLOPE, STEP
from pam_gap.fleet.series import ParameterSeries, day

LOOK = {"font.size": 9}
VALUE, MODEL, CHANGE = "#00798c", "0.15", "#c2410c"
SOURCES = {
    "stamps": "stamps of the recording",
    "table": "table of rigs",
    "file": "time of the file",
}

_BODY = """
<div class="verdict" style="--verdict: {{ colour }}"><b>{{ word }}</b>
{% for text in changed %}{{ text }}<br>{% else %}{{ nothing }}{% endfor %}
<small>{{ span }}</small></div>
{% if next %}<h2>What will need repair next</h2>
{{ table(['robot', 'joint', 'what grows', '#weeks left', 'until it'], next) }}
<p class="quiet">At the present rate. Set a limit with --limit EFFECT.PARAMETER=VALUE; without one,
this is the time until the value has doubled.</p>{% endif %}
{% for group in groups %}<h2>{{ group.title }}</h2>
{% if not group.plots %}<p>No effect was found in several recordings, so that none is followed.</p>
{% endif %}
{% for plot in group.plots %}{{ plot.picture | safe }}
{% for text in plot.sentences %}<p>{{ text }}</p>{% endfor %}{% endfor %}
{% for name, reason in group.failures %}<p class="quiet">Not fitted: {{ name }}: {{ reason }}</p>
{% endfor %}{% endfor %}
{% if groups %}<p class="quiet">The effects that several recordings show are fitted on every
recording of a joint, also where the verdict was another one. Bars: 90 % intervals of single
recordings. Line: a constant with steps and slopes where the Bayesian information criterion asks for
them. Dashed: the date of a change; orange: its 90 % interval.</p>{% endif %}
{% if failed %}<h2>Recordings that failed</h2>
{{ table(['recording', 'reason'], failed) }}{% endif %}
<h2>All recordings</h2>
{{ table(['#date (UTC)', 'recording', 'robot', 'joint', 'verdict', 'effects'], rows) }}
<p class="quiet">{{ sources }}</p>
"""


def draw_series(series: ParameterSeries, width: float) -> Figure:
    """Draw values with intervals, the model and its changes, in a width [in]."""
    figure = Figure(figsize=(width, 3.0), layout="constrained")
    axis = figure.subplots()
    points, course = series.points, series.course
    unit, factor = user_unit(max(abs(p.value) for p in points), series.unit)
    dates: Any = [datetime.fromtimestamp(p.time, UTC) for p in points]
    value = factor * np.array([p.value for p in points])
    reach = np.abs(factor * np.array([[p.low, p.high] for p in points]).T - value)
    for change in course.changes:
        ends: Any = [datetime.fromtimestamp(t, UTC) for t in (change.earliest, change.latest)]
        if not change.from_start:
            axis.axvspan(*ends, color=CHANGE, alpha=0.15, lw=0)
            middle: Any = datetime.fromtimestamp(change.time, UTC)
            axis.axvline(middle, color=CHANGE, ls="--", lw=1.2)
    axis.errorbar(dates, value, yerr=reach, fmt="o", color=VALUE, ms=4, lw=1, label="one recording")
    breaks = [0, *sorted(
        int(np.searchsorted([p.time for p in points], c.time))
        for c in course.changes if c.kind == STEP
    ), len(points)]  # fmt: skip
    for k, (first, last) in enumerate(itertools.pairwise(breaks)):
        axis.plot(
            dates[first:last], factor * course.curve[first:last], color=MODEL, lw=1.5,
            label="steps and slopes" if k == 0 else None,
        )  # fmt: skip
    if series.limit is not None:
        axis.axhline(factor * series.limit, color=CHANGE, lw=1, label="limit")
    axis.set_ylabel(series.name.partition(", ")[2] + ("" if unit == "-" else f" [{unit}]"))
    dates_of: Any = mdates  # untyped
    axis.xaxis.set_major_formatter(dates_of.ConciseDateFormatter(axis.xaxis.get_major_locator()))
    axis.set_title(f"{series.name} ({series.joint})", fontsize=10, loc="left")
    legend = axis.get_legend_handles_labels()
    if is_narrow(width):
        figure.legend(*legend, loc="outside lower center", ncols=3)
    else:
        figure.legend(*legend, loc="outside upper right", ncols=3)
    axis.grid(axis="y", color="0.92")
    return figure


def _alt(series: ParameterSeries, sentences: Sequence[str]) -> str:
    values = [p.value for p in series.points]
    span = f"{told(min(values), series.unit)} to {told(max(values), series.unit)}"
    return (
        f"{series.name} of {series.joint} over time, {len(values)} recordings from {span}. "
        f"{' '.join(sentences)}"
    )


def _groups(document: Mapping[str, Any], series: Sequence[ParameterSeries]) -> list[dict[str, Any]]:
    groups = []
    for followed in document["followed"]:
        where = (followed["robot"], followed["joint"])
        plots = [
            {
                "picture": picture(partial(draw_series, one), _alt(one, entry["sentences"]), LOOK),
                "sentences": entry["sentences"],
            }
            for one, entry in zip(series, document["series"], strict=True)
            if (one.robot, one.joint) == where
        ]
        groups.append(
            {
                "title": f"{where[1]} of {where[0]}",
                "plots": plots,
                "failures": followed["failures"],
            }
        )
    return groups


def _span(rows: Sequence[Mapping[str, Any]]) -> str:
    times = [row["time"] for row in rows]
    if not times:
        return ""
    return f"Recorded from {day(min(times))} to {day(max(times))}."


def _sources(rows: Sequence[Mapping[str, Any]]) -> str:
    used = {str(row["time_from"]) for row in rows}
    told_ = [
        f"{sum(row['time_from'] == key for row in rows)} from the {words}"
        for key, words in SOURCES.items()
        if key in used
    ]
    return f"Dates: {', '.join(told_)}."


def render(document: Mapping[str, Any], series: Sequence[ParameterSeries]) -> str:
    """Return the page as text."""
    rows = document["recordings"]
    changed = [text for s in document["series"] if s["changes"] for text in s["sentences"]]
    grows = any(c.kind == SLOPE for s in series for c in s.course.changes)
    return html_page(
        f"Fleet: {len({row['recording'] for row in rows})} recordings",
        _BODY,
        colour="#c2410c" if grows else "#00798c" if changed else "#2f855a",
        word="Something changes" if changed else "No change found",
        nothing="No followed effect changed by more than its recordings differ.",
        changed=changed,
        span=_span(rows),
        next=[
            (row["robot"], row["joint"], row["what"], f"{row['weeks']:.0f}", row["aim"])
            for row in document["next"]
        ],
        groups=_groups(document, series),
        failed=[(row["recording"], row["failure"]) for row in rows if row["failure"]],
        rows=[
            (
                f"{datetime.fromtimestamp(row['time'], UTC):%Y-%m-%d %H:%M}",
                _linked(row["recording"], row["link"]),
                row["robot"],
                row["joint"],
                _word(row),
                spoken(row["effects"]),
            )
            for row in rows
        ],
        sources=_sources(rows),
    )


def _linked(text: str, address: str) -> str:
    return marked_up('<a href="{}">{}</a>', address, text) if address else text


def _word(row: Mapping[str, Any]) -> str:
    if row["failure"]:
        return "failed"
    return VERDICT_WORDS.get(row["verdict"], "Only followed, not diagnosed")


def write_page(document: Mapping[str, Any], series: Sequence[ParameterSeries], path: Path) -> None:
    """Write the page to `path`."""
    path.write_text(render(document, series), encoding="utf-8")
