"""The page of close-loop: one HTML file with verdict, tracking before and after, and plots."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from pam_demo.tracking import ClosedLoopFigure, FollowedAngle
from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.html_page import html_page, marked_up
from pam_gap.answer.page_style import PLOT_LOOK
from pam_gap.answer.plots_in_page import picture
from pam_gap.answer.report import parameter_rows

ASKED, BEFORE, AFTER = "#1d2433", "#d1495b", "#00798c"
LOOK: Any = PLOT_LOOK | {  # matplotlib's own type lists every key
    "lines.linewidth": 1.1,
    "svg.hashsalt": "close-loop",
}
_BODY = """
<p class="quiet">Driver, model and controller ran in one process and moved a simulated rig
over a CAN bus. The simulated rig has the effect <b>{{ hidden }}</b>, which is missing in its
rig file. The recording of the first run was diagnosed.{% if figures %}
In the second run, on the same rig, every node used the improved rig file.{% endif %}</p>
<h2>Verdict</h2><p class="verdict">{{ diagnosis.sentence }}</p>
{% if parameters %}
{{ table(['effect', 'parameter', '#found', '#90 % interval', 'unit'], parameters) }}{% endif %}
<h2>RMS tracking error{% if runs > 1 %}, median of {{ runs }} runs{% endif %}</h2>
{% if figures %}{{ table(['motion', '#before [mrad]', '#after [mrad]', '#after/before',
'#true, before [mrad]', '#true, after [mrad]'], figures) }}
<p class="quiet">Measured error: reference angle minus joint_states. True error: reference angle
minus the plant's own angle, which was available neither to the controller nor to the diagnosis.</p>
{% else %}<p>The diagnosis found no change for the rig file, so there was no second run.</p>
{% endif %}
{% for title, picture in plots %}<h2>{{ title }}</h2>{{ picture | safe }}{% endfor %}
<p class="quiet">The full diagnosis: <a href="diagnosis/report.html">diagnosis/report.html</a>.</p>
"""


def _plot(before: FollowedAngle, after: FollowedAngle | None, width: float) -> Figure:
    canvas = Figure(figsize=(width, 4.6), layout="constrained")
    top, bottom = canvas.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    top.plot(before.times, before.asked, color=ASKED, label="reference")
    top.plot(before.times, before.angle, color=BEFORE, label="before")
    bottom.plot(before.times, 1e3 * before.error, color=BEFORE)
    if after is not None:
        top.plot(after.times, after.angle, color=AFTER, label="after")
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
    before: Sequence[FollowedAngle],
    after: Sequence[FollowedAngle],
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
    before, after : sequence of FollowedAngle
        Measured angle in the motions of the first run on both sides; `after` may be empty.
    figures : sequence of ClosedLoopFigure
        Tracking errors before and after.
    runs : int, optional
        Of whose errors `figures` are the medians.
    """
    seconds = {one.motion.name: one for one in after}
    titles = {one.motion.name: one.motion.title for one in before}
    page = html_page(
        "Tracking before and after a diagnosis",
        _BODY,
        hidden=", ".join(hidden),
        diagnosis=diagnosis,
        parameters=parameter_rows(diagnosis.to_json()["parameters"]),
        figures=[_row(figure, titles[figure.motion]) for figure in figures],
        runs=runs,
        plots=[
            (
                one.motion.title,
                picture(
                    partial(_plot, one, seconds.get(one.motion.name)),
                    f"{one.motion.title}: angle and error before and after",
                    LOOK,
                ),
            )
            for one in before
        ],
    )
    path.write_text(page, encoding="utf-8")


def _row(figure: ClosedLoopFigure, title: str) -> tuple[str, ...]:
    before, after, true_before, true_after = (
        f"{1e3 * error:.2f}"
        for error in (figure.before, figure.after, figure.true_before, figure.true_after)
    )
    look = "good" if figure.after < figure.before else "bad"
    ratio = marked_up('<span class="{}">{:.2f}</span>', look, figure.after / figure.before)
    return (title, before, after, ratio, true_before, true_after)
