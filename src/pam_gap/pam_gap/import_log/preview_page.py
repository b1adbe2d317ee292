"""A page that shows what was understood of a log, before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import starmap
from pathlib import Path

import numpy as np

from pam_gap.answer.html_page import html_page
from pam_gap.answer.traces import (
    IMPROVED,
    NO_FIGURES,
    Drawn,
    drawn_or_reason,
    embedded,
    thinned,
    time_figure,
    time_range,
)
from pam_gap.answer.user_units import told, user_unit
from pam_gap.recordings.column_map import ColumnMap, MappedColumn, unit_of
from pam_gap.recordings.recording import COMMANDS, Array, Recording
from pam_ros.foreign_text import shown

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
    doubts: Sequence[str] = ()  # what a person has to check of a map that was proposed

    @property
    def unused(self) -> list[str]:
        """The columns with numbers that the map does not use."""
        used = self.column_map.columns
        return [name for name in self.columns if name not in used]


_BODY = """
<div class="verdict" style="--verdict: {{ '#c2410c' if p.problems else '#00798c' }}">
<b>{{ 'A diagnosis would refuse this' if p.problems else 'Understood' }}</b>
{% for text in p.problems %}{{ text }}<br>{% else %}{{ summary }}{% endfor %}
{% for text in p.no_verdict %}<br>No verdict can follow: {{ text }}{% endfor %}
{% for text in p.doubts %}<br>Check: {{ text }}.{% endfor %}
{% for text in p.damage %}<br>Damaged: {{ text }}.{% endfor %}</div>
{% if rows %}<h2>Channels</h2>
{{ table(['channel', 'column of the log', 'read as', '#smallest', '#largest'], rows) }}{% endif %}
{% if no_plots %}<p class="quiet">There are no plots here: {{ no_plots }}.</p>{% endif %}
{% for part, alt in plots %}<figure class="plot" aria-label="{{ alt }}">
{{ part | safe }}</figure>{% endfor %}
{% if p.recording and p.recording.repairs %}<h2>Repairs</h2>
<ul>{% for text in p.recording.repairs %}<li>{{ text }}</li>{% endfor %}</ul>{% endif %}
{% if p.missing %}<h2>What is missing</h2>
<ul>{% for text in p.missing %}<li>{{ text }}</li>{% endfor %}</ul>{% endif %}
{% if unused %}<h2>Columns that are not used</h2>
{{ table(['column', '#values', '#smallest', '#largest'], unused) }}
{% if more %}<p class="quiet">and {{ more }} more</p>{% endif %}{% endif %}
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


def _row(recording: Recording, column_map: ColumnMap, channel: str) -> tuple[str, ...]:
    entry, values = column_map.channels[channel], recording.values[channel]
    unit = _unit(channel)
    ends = (told(float(end), unit, 3) for end in (values.min(), values.max()))
    columns = " + ".join(map(shown, entry.columns))
    return (channel, columns, conversion(entry, channel) or "as it is", *ends)


def _drawn(recording: Recording) -> Drawn:
    shared = time_range(0.0, float(recording.time[-1]))
    figures = []
    for channel, values in recording.values.items():
        unit, factor = user_unit(float(np.abs(values).max()), unit_of(channel).split(" ")[0])
        made = time_figure("" if unit in ("", "-") else f"[{unit}]", shared, channel)
        x, y = thinned(recording.time, factor * values, POINTS)
        draw = made.step if channel.startswith(COMMANDS) else made.line
        draw(x.astype(np.float32), y.astype(np.float32), color=IMPROVED, line_width=1.3)
        figures.append(made)
    return embedded(figures)


def _alt(channel: str, values: Array) -> str:
    low, high = (told(float(end), "", 3) for end in (values.min(), values.max()))
    return f"{channel} over time, from {low} to {high} {unit_of(channel)}"


def render(preview: Preview) -> str:
    """Return the page as text."""
    recording = preview.recording
    drawn, no_plots = NO_FIGURES, ""
    if recording is not None and recording.values:
        drawn, no_plots = drawn_or_reason(partial(_drawn, recording))
    unused = [
        (shown(name), count, f"{low:.4g}", f"{high:.4g}")
        for name, (count, low, high) in ((n, preview.columns[n]) for n in preview.unused)
    ]
    summary = ""
    if recording is not None:
        summary = (
            f"{recording.duration:.3g} s at {1.0 / recording.sample_time:.4g} Hz, "
            f"{len(recording.values)} channels."
        )
    return html_page(
        f"Preview of {preview.source.name}",
        _BODY,
        script=drawn.script,
        p=preview,
        summary=summary,
        rows=[]
        if recording is None
        else [
            _row(recording, preview.column_map, channel)
            for channel in preview.column_map.channels
            if recording.has(channel)
        ],
        plots=[]
        if recording is None
        else list(zip(drawn.parts, starmap(_alt, recording.values.items()), strict=False)),
        no_plots=no_plots,
        unused=unused[:MOST_UNUSED],
        more=max(len(unused) - MOST_UNUSED, 0),
    )
