"""The page of a commissioning: what was done, what was found, and tracking before and after."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.expected_tracking import Expected
from pam_demo.commission.tracking import Tracked
from pam_gap.answer.html_page import breakable, html_page
from pam_gap.answer.page_style import PLOT_LOOK
from pam_gap.answer.plots_in_page import picture
from pam_gap.answer.user_units import plain
from pam_gap.calibration.answer import interval_words, status_words, written_value

LOOK: Any = PLOT_LOOK | {"lines.linewidth": 1.1, "svg.hashsalt": "commission"}
SAME: Final = 1e-3
"""References that differ by less are the same to a reader [rad]."""
ASKED, BEFORE, AFTER = "#1d2433", "#d1495b", "#00798c"
_BODY = """
<div class="verdict" style="--verdict: {{ '#c2410c' if ended or doubt else '#00798c' }}">
<b>{{ 'Ended' if ended else 'Commissioned' }}</b>{{ ended or summary }}</div>
{% if exchanged %}<p>{{ exchanged }}</p>{% endif %}
{% if tests %}<h2>Tracking</h2>
{{ table(['rig file', '#RMS error [mrad]', '#largest [mrad]', 'remark'], tests) }}
{% if expected %}<p class="quiet">{{ expected }}</p>{% endif %}
{% if apart %}<p class="quiet">{{ apart }}</p>{% endif %}
<figure>{{ plot | safe }}</figure>{% endif %}
{% if steps %}<h2>Steps</h2>
{{ table(['motion', '#size', '#pressure', '#speed', '#range'], steps) }}
<p class="quiet">Pressure, speed and range are shares of the limits: as measured, and in brackets as
foreseen for the least favourable robot that the numbers permitted then.</p>{% endif %}
{% if rows %}<h2>Numbers</h2>
{{ table(['number', '#as written', '#now', '#90 % interval', '#as a ratio',
'unit', 'what the motions say'], rows) }}
<p class="quiet">Pressures and angles fix ratios: inertia, gravity, conductances and volumes all
grow with the pull of the muscles. The second interval is that of such a ratio. How the joint moves
and how its controller is designed depend on the ratios alone.</p>{% endif %}
{% if gains %}<h2>Gains</h2>
{{ table(['#stiffness [N m/rad]', '#proportional [N m/rad]', '#integral [N m/(rad s)]',
'#derivative [N m s/rad]'], gains) }}
<p class="quiet">The controller designs them by itself from the rig file.</p>{% endif %}
{% if not ended %}<h2>What next</h2>
<p>Start all nodes with <code>commissioned.yaml</code>, the driver with its checks on again.</p>
{% endif %}
"""


def _mrad(value: float) -> str:
    return plain(1e3 * value, 3) if math.isfinite(value) else "-"


def _expected(on_robots: Expected | None) -> str:
    if on_robots is None:
        return ""
    ends = f"{_mrad(on_robots.errors[0])} to {_mrad(on_robots.errors[-1])}"
    return (
        f"On simulated robots that the recordings permit, the test gives {ends} mrad RMS, and on "
        f"one with exactly the identified numbers {_mrad(on_robots.known)} mrad. A smaller error "
        "than these is good news."
    )


def _apart(before: Tracked | None, after: Tracked | None) -> str:
    """What is to be said where both tests had other references; empty if they had the same."""
    tables = [one.table for one in (before, after) if one is not None and len(one.table)]
    count = min(map(len, tables), default=0)
    if len(tables) < 2 or count == 0:
        return ""
    references = [table["reference"].to_numpy()[:count] for table in tables]
    apart = float(np.abs(references[0] - references[1]).max())
    if apart < SAME:
        return ""
    return (
        f"The controller slows a motion down to what the robot of its rig file can do: the two "
        f"references are up to {plain(apart, 2)} rad apart. The error is that from its own "
        "reference."
    )


def plot_of(before: Tracked | None, after: Tracked | None, width: float) -> Figure:
    """Angles and errors of both tests in a width [in]; on the angles alone, the errors are lost."""
    figure = Figure(figsize=(width, 4.6), layout="constrained")
    angle, error = figure.subplots(2, sharex=True)
    shown = [
        (tracked.table, colour, label)
        for tracked, colour, label in (
            (before, BEFORE, "rig file as it was"),
            (after, AFTER, "identified rig file"),
        )
        if tracked is not None and len(tracked.table)
    ]
    for table, colour, label in shown:
        angle.plot(table["time"], table["reference"], color=colour, ls="--", lw=0.9)
        angle.plot(table["time"], table["position"], color=colour, label=label)
        lost = 1e3 * (table["reference"] - table["position"])
        error.plot(table["time"], lost, color=colour)
    if shown:
        angle.plot([], [], color=ASKED, ls="--", lw=0.9, label="references")
        figure.legend(loc="outside upper left", ncols=3 if width > 6.0 else 1)
    error.set_xlabel("time [s]")
    angle.set_ylabel("angle [rad]")
    error.set_ylabel("error [mrad]")
    return figure


def render(joint: str, done: Commissioned) -> str:
    """The page as text.

    Parameters
    ----------
    joint : str
        Name of the joint.
    done : Commissioned
        What was found.
    """
    numbers = done.calibration.numbers if done.calibration is not None else ()
    tests = [
        (name, _mrad(one.rms), _mrad(one.largest), one.stopped)
        for name, one in (("as it was", done.before), ("identified", done.after))
        if one is not None
    ]
    summary = ""
    if done.after is not None:
        summary = done.doubt or f"The joint tracks with {_mrad(done.after.rms)} mrad RMS."
    return html_page(
        f"Commissioning of {joint}",
        _BODY,
        ended=done.ended,
        doubt=done.doubt,
        exchanged=done.exchanged,
        expected=_expected(done.expected),
        apart=_apart(done.before, done.after),
        gains=[tuple(plain(value, 3) for value in row.values()) for row in done.gains],
        summary=summary,
        tests=tests,
        plot=picture(
            partial(plot_of, done.before, done.after),
            "Angle of the joint in the tracking tests, its reference and its error",
            LOOK,
        )
        if tests
        else "",
        steps=[
            (
                f"{step.motion}: {step.title}",
                f"{step.share:.0%}",
                *(f"{m:.0%} ({f:.0%})" for m, f in zip(step.most, step.foreseen, strict=True)),
            )
            for step in done.steps
        ],
        rows=[
            (
                breakable(one.key),
                written_value(one),
                plain(one.value, 4),
                interval_words(one.low, one.high),
                "" if one.relative is None else interval_words(*one.relative),
                one.unit,
                status_words(one),
            )
            for one in numbers
        ],
    )


def write_page(joint: str, done: Commissioned, path: Path) -> None:
    """Write the page to a file."""
    path.write_text(render(joint, done), encoding="utf-8")
