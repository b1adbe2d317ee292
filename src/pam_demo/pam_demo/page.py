"""The demo's page: one HTML file that contains its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from pam_demo.figures import (
    LATE,
    NAMES,
    Figure,
    Play,
    Results,
    asked_stiffness,
    target_text,
)
from pam_demo.recording import Array
from pam_gap.answer.html_page import html_page, marked_up
from pam_gap.answer.page_style import PLOT_LOOK
from pam_gap.answer.plots_in_page import WIDE, is_narrow, picture
from pam_gap.answer.user_units import told
from pam_ros.valve_command import FLOW

COLOURS = {"full": "#1f5fbf", "no_feedforward": "#d9822b", "pressure_ratio_pid": "#8e5bb5"}
ASKED = "#1d2433"
PAIR = ("#c2452d", "#2d8a8a")
POINTS = 1500  # per line: more than the page has pixels
NARROW_POINTS = 600
STYLE: Any = PLOT_LOOK | {  # matplotlib's own type lists every key
    "font.family": "sans-serif",
    "axes.labelcolor": "#5d6778",
    "xtick.color": "#5d6778",
    "ytick.color": "#5d6778",
    "lines.linewidth": 1.2,
    "svg.fonttype": "path",
    "svg.hashsalt": "demo",
}
PAGE_STYLE = """
 .cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(13rem, 1fr)); gap: .8rem;
          margin: 1.2rem 0; }
 .card { background: var(--box); border: 1px solid var(--line); border-radius: .5rem;
         padding: .9rem 1.1rem; break-inside: avoid; }
 .card b { display: block; font-size: 1.55rem; font-variant-numeric: tabular-nums; }
 .card span { display: block; color: var(--quiet); font-size: .86rem; line-height: 1.35; }
"""
BODY = """
<p class="quiet">The valve boards are simulated and connected by a CAN bus ({{ bus }}); driver,
model and controller run {{ processes }}. {{ rate_sentence }}
All numbers and plots on this page were computed from the recording of the ROS 2 topics.</p>
<div class="cards">
{% for f in headline %}<div class="card"><b class="{{ css(f) }}">{{ text(f.value, f.unit) }}</b>
<span>{{ f.text }}{% if f.target is not none %}<br>target: {{ target(f) }}{% endif %}
{%- if f.reason %}<br>missed: {{ f.reason }}{% endif %}</span></div>
{% endfor %}</div>
{% for title, picture in plots %}<h2>{{ title }}</h2>{{ picture | safe }}{% endfor %}
<h2>All figures</h2>{{ table(['figure', '#value', 'target'], figures) }}
<h2>Remarks</h2><ul>{% for note in notes %}<li>{{ note }}</li>{% endfor %}</ul>
"""
HEADLINE = (
    "arm_rms",
    "chirp_1hz_rms",
    "stiffness_deviation",
    "arm_ratio_no_feedforward",
    "arm_ratio_pressure_ratio_pid",
    "controller_late",
)


def _line(axes: Axes, times: Array, values: Array, **style: Any) -> None:
    """Plot at most as many points as can be seen, keeping the extremes of each interval."""
    inches = axes.figure.bbox.width / axes.figure.dpi
    points = NARROW_POINTS if is_narrow(inches) else POINTS
    if len(times) > points:
        width = -(-2 * len(times) // points)
        count = len(times) // width
        blocks = values[: count * width].reshape(count, width)
        rows = np.arange(count) * width
        keep = np.sort(np.concatenate([rows + blocks.argmin(1), rows + blocks.argmax(1)]))
        times, values = times[keep], values[keep]
    axes.plot(times, values, **style)


def _motion_plot(plays: list[Play], muscles: Mapping[str, str], width: float = WIDE) -> Canvas:
    """One column of axes for one motion: angle, error, stiffness, pressures, valves."""
    first = plays[0]
    canvas = Canvas(figsize=(width, 9.0), layout="constrained")
    rows = canvas.subplots(5, 1, sharex=True, height_ratios=[2.2, 1.4, 1.2, 1.2, 1.0])
    angle, error, stiffness, pressure, valve = rows
    for play in reversed(plays):
        colour, name = COLOURS[play.law], NAMES[play.law]
        _line(angle, play.joint.times, play.joint.angle, color=colour, label=name)
        _line(error, play.joint.times, 1e3 * play.joint.error, color=colour, label=name)
    _line(
        angle,
        first.joint.times,
        first.joint.asked,
        color=ASKED,
        linestyle="--",
        linewidth=1.0,
        label="reference",
    )
    angle.set_ylabel("angle [rad]")
    error.set_ylabel("error [mrad]")
    times = first.stiffness.times
    _line(stiffness, times, first.stiffness.values, color=COLOURS["full"], label="actual")
    _line(
        stiffness,
        times,
        asked_stiffness(first.motion, times),
        color=ASKED,
        linestyle="--",
        linewidth=1.0,
        label="reference",
    )
    stiffness.set_ylabel("stiffness\n[N m/rad]")
    stiffness.set_ylim(0.0, 1.1 * stiffness.get_ylim()[1])
    for (name, kind), colour, pressures, commands in zip(
        muscles.items(), PAIR, first.pressures, first.valves, strict=False
    ):
        _line(pressure, pressures.times, pressures.values / 1e5, color=colour, label=name)
        scale = 1.0 if kind == FLOW else 1e5
        _line(
            valve, commands.times, commands.values / scale, color=colour, label=name, linewidth=0.8
        )
    pressure.set_ylabel("pressure\n[bar gauge]")
    units = {"-1..1" if kind == FLOW else "bar gauge" for kind in muscles.values()}
    valve.set_ylabel(f"valve\n[{' or '.join(sorted(units))}]")
    valve.set_xlabel("time [s]")
    for axes in (angle, stiffness, pressure):
        if width < WIDE:  # above the plot, where it takes no width
            axes.legend(loc="lower left", bbox_to_anchor=(-0.1, 1.0), ncols=2, columnspacing=1.0)
        else:
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.05), borderaxespad=0.3)
    angle.set_xlim(0.0, first.motion.duration)
    canvas.align_ylabels(rows)
    return canvas


def _histogram(results: Results, width: float = WIDE) -> Canvas:
    count = len(results.periods)
    below = count if width < WIDE else 1
    canvas = Canvas(figsize=(width, 2.6 * below), layout="constrained")
    columns = canvas.subplots(below, count // below, squeeze=False).ravel()
    period = 1.0 / results.rate
    edges = np.linspace(0.0, 3.0 * period, 121)
    for axes, (topic, periods) in zip(columns, results.periods.items(), strict=True):
        inside = np.clip(periods, edges[0], edges[-1])
        axes.hist(1e3 * inside, bins=1e3 * edges, color=COLOURS["full"])
        axes.axvline(
            1e3 * (1.0 + LATE) * period, color=PAIR[0], linewidth=1.0, label="late from here"
        )
        axes.set_yscale("log")
        axes.legend(loc="upper right")
        axes.set_title(topic, fontsize=10)
        label = "time between stamps [ms]; the last bar counts all longer times"
        axes.set_xlabel(label.replace("; ", "\n") if width < WIDE else label)
    columns[0].set_ylabel("count")
    return canvas


def write_picture(path: Path, results: Results, muscles: Mapping[str, str]) -> Path:
    """Draw the arm's motion as one picture, which README shows.

    Parameters
    ----------
    path : Path
        PNG file to write.
    results : Results
        The first motion is drawn with every control law that played it.
    muscles : mapping
        Muscle -> kind of its valve, in the order of the recorded arrays.

    Returns
    -------
    Path
        The same.
    """
    first = results.plays[0].motion.name
    plays = [play for play in results.plays if play.motion.name == first]
    with mpl.rc_context(STYLE):
        canvas = _motion_plot(plays, muscles)
        canvas.suptitle(plays[0].motion.title, fontsize=12)
        canvas.savefig(path, dpi=110)
    return path


def _alt(plays: Sequence[Play]) -> str:
    """What the plot of a motion shows, for those who do not see it."""
    errors = [
        f"{NAMES[play.law]} {told(play.joint.rms(play.motion.windows), 'rad')}" for play in plays
    ]
    return (
        f"{plays[0].motion.title}: angle, error, stiffness, pressures and valves over time. "
        f"RMS errors: {', '.join(errors)}."
    )


def _css(figure: Figure) -> str:
    return {None: "", True: "good", False: "bad"}[figure.met]


def _row(figure: Figure) -> tuple[str, str, str]:
    text = figure.text
    if figure.reason:
        text = marked_up("{}<br><small>missed: {}</small>", text, figure.reason)
    value = marked_up(
        '<span class="{}">{}</span>', _css(figure), told(figure.value, figure.unit, 3)
    )
    return text, value, target_text(figure).replace(" %", "\xa0%")


def write_page(
    path: Path,
    results: Results,
    bus: str,
    muscles: Mapping[str, str],
    rate_sentence: str,
    *,
    separate: bool = False,
) -> Path:
    """Write the page.

    Parameters
    ----------
    path : Path
        File to write.
    results : Results
        What the page shows.
    bus : str
        Description of the bus.
    muscles : mapping
        Muscle -> kind of its valve, in the order of the recorded arrays.
    rate_sentence : str
        At which rate the loops ran, and why.
    separate : bool, optional
        Whether driver, model and controller were processes of their own.

    Returns
    -------
    Path
        The same.
    """
    plots = []
    for motion in dict.fromkeys(play.motion.name for play in results.plays):
        plays = [play for play in results.plays if play.motion.name == motion]
        draw = partial(_motion_plot, plays, muscles)
        plots.append((plays[0].motion.title, picture(draw, _alt(plays), STYLE)))
    title = "Period of the controller loop"
    alt = f"{title}: histogram on a logarithmic scale; a line marks where a period counts as late."
    plots.append((title, picture(partial(_histogram, results), alt, STYLE)))
    by_key = {figure.key: figure for figure in results.figures}
    html = html_page(
        "Control of a joint with pneumatic muscles",
        BODY,
        style=PAGE_STYLE,
        bus=bus,
        rate_sentence=rate_sentence,
        processes="as separate processes" if separate else "in one process",
        headline=[by_key[key] for key in HEADLINE if key in by_key],
        figures=[_row(figure) for figure in results.figures],
        notes=results.notes,
        plots=plots,
        text=partial(told, digits=3),
        target=target_text,
        css=_css,
    )
    path.write_text(html, encoding="utf-8")
    return path
