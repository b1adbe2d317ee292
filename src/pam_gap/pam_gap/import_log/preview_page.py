"""A page that shows what was understood of a log, before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from pam_gap.answer.page_style import STYLE
from pam_gap.answer.traces import IMPROVED, thinned
from pam_gap.answer.user_units import told, user_unit
from pam_gap.recordings.column_map import ColumnMap, MappedColumn, unit_of
from pam_gap.recordings.recording import COMMANDS, Recording
from pam_ros.foreign_text import shown
from pam_ros.missing_packages import what_to_install

POINTS = 3000
MOST_UNUSED = 300
"""Columns that are listed although they are not used."""


@dataclass(frozen=True)
class Preview:
    """What the page shows."""

    source: Path  # the log
    # number of values, smallest and largest of each column of the log, in its own unit
    columns: Mapping[str, tuple[int, float, float]]
    column_map: ColumnMap  # what is read from it
    recording: Recording | None  # the recording on an even time grid; None if it cannot be made
    problems: Sequence[str]  # why a diagnosis would refuse it; empty if it would not
    missing: Sequence[str]  # what a diagnosis cannot judge without channels that are not there
    damage: Sequence[str] = ()  # what could not be read
    no_verdict: Sequence[str] = ()  # why no verdict can follow from this recording alone

    @property
    def unused(self) -> list[str]:
        """The columns with numbers that the map does not use."""
        used = self.column_map.columns
        return [name for name in self.columns if name not in used]


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Preview of {{ name }}</title>
<style>{{ style | safe }}</style></head><body><main>
<h1>Preview of {{ name }}</h1>
<div class="verdict" style="--verdict: {{ '#c2410c' if p.problems else '#00798c' }}">
<b>{{ 'A diagnosis would refuse this' if p.problems else 'Understood' }}</b>
{% for text in p.problems %}{{ text }}<br>{% else %}{{ summary }}{% endfor %}
{% for text in p.no_verdict %}<br>No verdict can follow: {{ text }}{% endfor %}
{% for text in p.damage %}<br>Damaged: {{ text }}.{% endfor %}</div>
{% if rows %}<h2>Channels</h2>
<div class="wide" tabindex="0"><table>
<tr><th>channel</th><th>column of the log</th><th>read as</th><th class="n">smallest</th>
<th class="n">largest</th></tr>
{% for row in rows %}<tr><td>{{ row.channel }}</td><td>{{ row.column }}</td><td>{{ row.how }}</td>
<td class="n">{{ row.low }}</td><td class="n">{{ row.high }}</td></tr>
{% endfor %}</table></div>{% endif %}
{% if no_plots %}<p class="quiet">There are no plots here: {{ no_plots }}.</p>{% endif %}
{% for plot in plots %}<figure class="plot" aria-label="{{ plot.alt }}">
{{ plot.part | safe }}</figure>{% endfor %}
{% if p.recording and p.recording.repairs %}<h2>Repairs</h2>
<ul>{% for text in p.recording.repairs %}<li>{{ text }}</li>{% endfor %}</ul>{% endif %}
{% if p.missing %}<h2>What is missing</h2>
<ul>{% for text in p.missing %}<li>{{ text }}</li>{% endfor %}</ul>{% endif %}
{% if unused %}<h2>Columns that are not used</h2>
<div class="wide" tabindex="0"><table><tr><th>column</th><th class="n">values</th>
<th class="n">smallest</th>
<th class="n">largest</th></tr>
{% for row in unused %}<tr><td>{{ row[0] }}</td><td class="n">{{ row[1] }}</td>
<td class="n">{{ '%.4g' % row[2] }}</td><td class="n">{{ '%.4g' % row[3] }}</td></tr>{% endfor %}
</table></div>{% if more %}<p class="quiet">and {{ more }} more</p>{% endif %}{% endif %}
{{ script | safe }}
</main></body></html>
"""


def _unit(channel: str) -> str:
    return unit_of(channel).split()[0] if unit_of(channel) else ""


def conversion(entry: MappedColumn, channel: str) -> str:
    """What is done to a column to make it a channel, such as "× 100000"; empty for nothing."""
    if not entry.columns:
        return f"held at {entry.offset:.6g} {_unit(channel)}"
    factor = f"× {entry.factor:.6g}" if entry.factor != 1.0 else ""
    offset = f"{entry.offset:+.6g} {_unit(channel)}" if entry.offset else ""
    return " ".join(part for part in (factor, offset) if part)


def _row(recording: Recording, column_map: ColumnMap, channel: str) -> dict[str, str]:
    entry, values = column_map.channels[channel], recording.values[channel]
    unit = _unit(channel)
    return {
        "channel": channel,
        "column": " + ".join(map(shown, entry.columns)),
        "how": conversion(entry, channel) or "as it is",
        "low": told(float(values.min()), unit, 3),
        "high": told(float(values.max()), unit, 3),
    }


def _plots(recording: Recording) -> tuple[str, list[dict[str, str]]]:
    if not recording.values:
        return "", []
    from bokeh.embed import components  # noqa: PLC0415  (optional)
    from bokeh.models import Range1d  # noqa: PLC0415
    from bokeh.plotting import figure  # noqa: PLC0415
    from bokeh.resources import Resources  # noqa: PLC0415

    shared: Any = Range1d(0.0, float(recording.time[-1]), bounds="auto")
    figures, alts = [], []
    for channel, values in recording.values.items():
        unit, factor = user_unit(float(np.abs(values).max()), unit_of(channel).split(" ")[0])
        made: Any = figure(
            height=190, sizing_mode="stretch_width", min_width=280, x_range=shared, title=channel,
            tools="xpan,xbox_zoom,reset", active_drag="xbox_zoom",
            y_axis_label="" if unit in ("", "-") else f"[{unit}]", x_axis_label="time [s]",
        )  # fmt: skip
        made.toolbar.logo = None
        x, y = thinned(recording.time, factor * values, POINTS)
        draw = made.step if channel.startswith(COMMANDS) else made.line
        draw(x.astype(np.float32), y.astype(np.float32), color=IMPROVED, line_width=1.3)
        figures.append(made)
        low, high = told(float(values.min()), "", 3), told(float(values.max()), "", 3)
        alts.append(f"{channel} over time, from {low} to {high} {unit_of(channel)}")
    script, parts = components(tuple(figures))
    library = Resources(mode="inline", components=["bokeh"]).render_js()
    return f"{library}\n{script}", [
        {"part": part, "alt": alt} for part, alt in zip(parts, alts, strict=True)
    ]


def render(preview: Preview) -> str:
    """Return the page as text."""
    recording = preview.recording
    script, plots, no_plots = "", list[dict[str, str]](), ""
    try:
        script, plots = _plots(recording) if recording is not None else ("", [])
    except ModuleNotFoundError as error:
        no_plots = what_to_install(error) or ""
        if not no_plots:
            raise
    unused = [(shown(name), *preview.columns[name]) for name in preview.unused]
    summary = ""
    if recording is not None:
        summary = (
            f"{recording.duration:.3g} s at {1.0 / recording.sample_time:.4g} Hz, "
            f"{len(recording.values)} channels."
        )
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(_PAGE).render(
        p=preview,
        name=preview.source.name,
        style=STYLE,
        summary=summary,
        rows=[]
        if recording is None
        else [
            _row(recording, preview.column_map, channel)
            for channel in preview.column_map.channels
            if recording.has(channel)
        ],
        plots=plots,
        no_plots=no_plots,
        unused=unused[:MOST_UNUSED],
        more=max(len(unused) - MOST_UNUSED, 0),
        script=script,
    )
