"""The page of close-loop: one HTML file with verdict, tracking before and after, and plots."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import jinja2
from matplotlib.figure import Figure

from pam_demo.tracking import ClosedLoopFigure, TrackedMotion
from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.page_style import PLOT_LOOK, STYLE
from pam_gap.answer.plots_in_page import picture
from pam_gap.answer.user_units import spoken

ASKED, BEFORE, AFTER = "#1d2433", "#d1495b", "#00798c"
LOOK: Any = PLOT_LOOK | {  # matplotlib's own type lists every key
    "lines.linewidth": 1.1,
    "svg.hashsalt": "close-loop",
}
TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Tracking before and after a diagnosis</title>
<style>{{ style | safe }}
 :root { --good: #1a7f4b; --bad: #b3261e; }
 @media (prefers-color-scheme: dark) { :root { --good: #5fd394; --bad: #ff8f86; } }
 .good { color: var(--good); } .bad { color: var(--bad); }
</style></head><body><main>
<h1>Tracking before and after a diagnosis</h1>
<p class="quiet">Driver, model and controller ran in one process and moved a simulated rig
over a CAN bus. The simulated rig has the effect <b>{{ hidden }}</b>, which is missing in its
rig file. The recording of the first run was diagnosed.{% if figures %}
In the second run, on the same rig, every node used the improved rig file.{% endif %}</p>
<h2>Verdict</h2><p class="verdict">{{ diagnosis.sentence }}</p>
{% if parameters %}
<div class="wide" tabindex="0"><table><tr><th>parameter</th><th class="n">found</th>
<th class="n">90 % interval</th><th>unit</th></tr>
{% for row in parameters %}<tr><td>{{ row[0] }}</td><td class="n">{{ row[1] }}</td>
<td class="n">{{ row[2] }} to {{ row[3] }}</td><td>{{ row[4] }}</td></tr>{% endfor %}</table></div>
{% endif %}
<h2>RMS tracking error{% if runs > 1 %}, median of {{ runs }} runs{% endif %}</h2>
{% if figures %}<div class="wide" tabindex="0"><table><tr><th>motion</th>
<th class="n">before [mrad]</th><th class="n">after [mrad]</th><th class="n">after/before</th>
<th class="n">true, before [mrad]</th><th class="n">true, after [mrad]</th></tr>
{% for f in figures %}<tr><td>{{ titles[f.motion] }}</td>
<td class="n">{{ "%.2f"|format(1e3 * f.before) }}</td>
<td class="n">{{ "%.2f"|format(1e3 * f.after) }}</td>
<td class="n {{ 'good' if f.after < f.before else 'bad' }}">{{ "%.2f"|format(f.after/f.before) }}
</td><td class="n">{{ "%.2f"|format(1e3 * f.true_before) }}</td>
<td class="n">{{ "%.2f"|format(1e3 * f.true_after) }}</td></tr>{% endfor %}</table></div>
<p class="quiet">Measured error: reference angle minus joint_states. True error: reference angle
minus the plant's own angle, which was available neither to the controller nor to the diagnosis.</p>
{% else %}<p>The diagnosis found no change for the rig file, so there was no second run.</p>
{% endif %}
{% for title, picture in plots %}<h2>{{ title }}</h2>{{ picture | safe }}{% endfor %}
<p class="quiet">The full diagnosis: <a href="diagnosis/report.html">diagnosis/report.html</a>.</p>
</main></body></html>
"""


def _plot(before: TrackedMotion, after: TrackedMotion | None, width: float) -> Figure:
    canvas = Figure(figsize=(width, 4.6), layout="constrained")
    top, bottom = canvas.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    top.plot(before.times, before.asked, color=ASKED, label="reference")
    top.plot(before.times, before.measured, color=BEFORE, label="before")
    bottom.plot(before.times, 1e3 * before.error, color=BEFORE)
    if after is not None:
        top.plot(after.times, after.measured, color=AFTER, label="after")
        bottom.plot(after.times, 1e3 * after.error, color=AFTER)
    top.set_ylabel("position [rad]")
    bottom.set_ylabel("error [mrad]")
    bottom.set_xlabel("time [s]")
    top.legend(loc="lower left", bbox_to_anchor=(-0.05, 1.0), ncols=3)
    return canvas


def write_page(
    path: Path,
    hidden: Sequence[str],
    diagnosis: Diagnosis,
    before: Sequence[TrackedMotion],
    after: Sequence[TrackedMotion],
    figures: Sequence[ClosedLoopFigure],
    runs: int = 1,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
        File to write.
    hidden : sequence of str
        The hidden effects.
    diagnosis : Diagnosis
        Result for the first run.
    before, after : sequence of TrackedMotion
        Motions of the first run on both sides; `after` may be empty.
    figures : sequence of ClosedLoopFigure
        Tracking errors before and after.
    runs : int, optional
        Of whose errors `figures` are the medians.
    """
    seconds = {motion.name: motion for motion in after}
    parameters = [
        (
            f"{spoken(effect)}, {spoken(name)}",
            f"{found.interval.value:.4g}",
            f"{found.interval.low:.4g}",
            f"{found.interval.high:.4g}",
            found.unit,
        )
        for effect, values in diagnosis.parameters.items()
        for name, found in values.items()
    ]
    page = jinja2.Environment(autoescape=True).from_string(TEMPLATE)
    path.write_text(
        page.render(
            style=STYLE,
            hidden=", ".join(hidden),
            diagnosis=diagnosis,
            parameters=parameters,
            figures=figures,
            runs=runs,
            titles={motion.name: motion.title for motion in before},
            plots=[
                (
                    motion.title,
                    picture(
                        partial(_plot, motion, seconds.get(motion.name)),
                        f"{motion.title}: angle and error before and after",
                        LOOK,
                    ),
                )
                for motion in before
            ],
        ),
        encoding="utf-8",
    )
