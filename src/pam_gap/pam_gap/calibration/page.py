"""The page of a calibration: numbers with intervals, and the prediction before and after."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from pam_gap.answer.html_page import breakable, html_page
from pam_gap.answer.traces import NO_FIGURES, Trace, draw, drawn_or_reason
from pam_gap.answer.user_units import plain, told
from pam_gap.calibration.answer import interval_words, sentence, status_words, written_value
from pam_gap.calibration.calibration import KEPT, Calibration
from pam_gap.prediction.channel_order import UNITS
from pam_gap.prediction.problem import PredictionProblem

CALIBRATED = "calibrated rig file"
_BODY = """
<div class="verdict" style="--verdict: {{ '#c2410c' if refused else '#00798c' }}">
<b>{{ 'No rig file' if refused else 'Calibrated' }}</b>{{ summary }}</div>
{% if rows %}<h2>Numbers</h2>
{{ table(['number', '#as written', '#now', '#90 % interval', '#as a ratio',
'unit', 'stage', 'what this log says'], rows) }}
<p class="quiet">A log of pressures and angles fixes ratios: inertia, gravity, conductance and
volumes all grow with the pull of the muscles. The second interval holds if the torque per
pressure is right, which only measured forces or a known weight determine. The motion that this rig
file predicts does not depend on it.</p>{% endif %}
{% if figures %}<h2>Prediction of {{ withheld }}</h2>
{{ table(['channel', 'horizon', '#as written', '#calibrated', '#noise alone'], figures) }}
{% endif %}
{% if no_plots %}<p class="quiet">There are no plots here: {{ no_plots }}.</p>{% endif %}
{% if drawn.parts %}<h2>Measured and predicted</h2>
{% for trace in traces %}<figure class="plot"><b>{{ trace.channel }}: measured and predicted</b>
{{ drawn.parts[2 * loop.index0] | safe }}</figure>
<figure class="plot"><b>{{ trace.channel }}: predicted minus measured</b>
{{ drawn.parts[2 * loop.index0 + 1] | safe }}</figure>{% endfor %}{% endif %}
{% if notes %}<h2>The data</h2><ul>{% for note in notes %}<li>{{ note }}</li>{% endfor %}</ul>
{% endif %}
"""


def traces(problem: PredictionProblem, before: np.ndarray, after: np.ndarray) -> list[Trace]:
    """Measured values of the first recording, and the predictions before and after."""
    errors = problem.errors(np.array([before, after]))[:, : problem.offsets[1]]
    data = problem.data[0]
    found = []
    for c in np.flatnonzero(problem.present):
        measured = data.rows(data.measured[:, c])
        predicted = measured - errors[:, :, c] * data.block_deviation[c]
        found.append(
            Trace(
                problem.names[c],
                UNITS[c],
                problem.row_time[: errors.shape[1]],
                measured,
                predicted[0],
                predicted[1],
                CALIBRATED,
            )
        )
    return found


def render(calibration: Calibration, withheld: str) -> str:
    """Return the page as text.

    Parameters
    ----------
    calibration : Calibration
        Of one joint.
    withheld : str
        What the prediction was tried on, in words.
    """
    rows = [
        (
            breakable(one.key),
            written_value(one),
            written_value(one) if one.status == KEPT else plain(one.value, 4),
            interval_words(one.low, one.high),
            "" if one.relative is None else interval_words(*one.relative),
            one.unit,
            one.stage,
            status_words(one),
        )
        for one in calibration.numbers
    ]
    drawn, no_plots, shown = NO_FIGURES, "", []
    if calibration.problem is not None and calibration.after is not None:
        assert calibration.before is not None
        shown = traces(calibration.problem, calibration.before, calibration.after)
        drawn, no_plots = drawn_or_reason(partial(draw, shown))
    return html_page(
        f"Calibration of {calibration.joint}",
        _BODY,
        script=drawn.script,
        refused=bool(calibration.refused),
        summary=sentence(calibration),
        rows=rows,
        figures=[
            (
                breakable(f.channel),
                f.horizon,
                *(told(x, f.unit) for x in (f.before, f.after, f.floor)),
            )
            for f in calibration.withheld
        ],
        withheld=withheld,
        no_plots=no_plots,
        drawn=drawn,
        traces=shown,
        notes=calibration.notes,
    )


def write_page(calibration: Calibration, withheld: str, path: Path) -> None:
    """Write the page to a file."""
    path.write_text(render(calibration, withheld), encoding="utf-8")
