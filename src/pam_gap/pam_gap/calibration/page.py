"""The page of a calibration: numbers with intervals, and the prediction before and after."""

from __future__ import annotations

from pathlib import Path

import jinja2
import numpy as np

from pam_gap.answer.page_style import BREAKABLE, STYLE
from pam_gap.answer.traces import Trace, draw
from pam_gap.answer.user_units import plain, told
from pam_gap.calibration.answer import STATUS, before, interval_words, sentence, what_would_help
from pam_gap.calibration.calibration import DETERMINED, KEPT, Calibration
from pam_gap.prediction.channel_order import UNITS
from pam_gap.prediction.channels import block_means
from pam_gap.prediction.problem import PredictionProblem
from pam_ros.missing_packages import what_to_install

CALIBRATED = "calibrated rig file"
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title><style>{{ style | safe }}</style></head><body><main>
<h1>{{ title }}</h1>
<div class="verdict" style="--verdict: {{ '#c2410c' if refused else '#00798c' }}">
<b>{{ 'No rig file' if refused else 'Calibrated' }}</b>{{ summary }}</div>
{% if rows %}<h2>Numbers</h2>
<div class="wide" tabindex="0"><table>
<tr><th>number</th><th class="n">as written</th><th class="n">now</th>
<th class="n">90 % interval</th><th>unit</th><th>stage</th><th>what this log says</th></tr>
{% for row in rows %}<tr><td>{{ breakable(row.key) }}</td><td class="n">{{ row.written }}</td>
<td class="n">{{ row.value }}</td><td class="n">{{ row.interval }}</td><td>{{ row.unit }}</td>
<td>{{ row.stage }}</td><td>{{ row.says }}</td></tr>
{% endfor %}</table></div>
<p class="quiet">A log of pressures and angles fixes ratios: inertia, gravity, conductance and
volumes all grow with the pull of the muscles. The interval in brackets holds if the torque per
pressure is right, which only measured forces or a known weight determine. The motion that this rig
file predicts does not depend on it.</p>{% endif %}
{% if figures %}<h2>Prediction of {{ withheld }}</h2>
<div class="wide" tabindex="0"><table><tr><th>channel</th><th>horizon</th>
<th class="n">as written</th><th class="n">calibrated</th><th class="n">noise alone</th></tr>
{% for f in figures %}<tr><td>{{ breakable(f[1]) }}</td><td>{{ f[0] }}</td>
<td class="n">{{ f[2] }}</td><td class="n">{{ f[3] }}</td><td class="n">{{ f[4] }}</td></tr>
{% endfor %}</table></div>{% endif %}
{% if no_plots %}<p class="quiet">There are no plots here: {{ no_plots }}.</p>{% endif %}
{% if drawn %}<h2>Measured and predicted</h2>
{% for trace in traces %}<figure class="plot"><b>{{ trace.channel }}: measured and predicted</b>
{{ drawn.parts[2 * loop.index0 + 1] | safe }}</figure>
<figure class="plot"><b>{{ trace.channel }}: predicted minus measured</b>
{{ drawn.parts[2 * loop.index0 + 2] | safe }}</figure>{% endfor %}{% endif %}
{% if notes %}<h2>The data</h2><ul>{% for note in notes %}<li>{{ note }}</li>{% endfor %}</ul>
{% endif %}</main>{% if drawn %}{{ drawn.script | safe }}{% endif %}
</body></html>
"""


def traces(problem: PredictionProblem, before: np.ndarray, after: np.ndarray) -> list[Trace]:
    """Measured values of the first recording, and the predictions before and after."""
    errors = problem.errors(np.array([before, after]))[:, : problem.offsets[1]]
    data = problem.data[0]
    found = []
    for c in np.flatnonzero(problem.present):
        measured = block_means(data.measured[:, c], problem.block)
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
        {
            "key": one.key,
            "written": before(one),
            "value": before(one) if one.status == KEPT else plain(one.value, 4),
            "interval": interval_words(one.low, one.high),
            "unit": one.unit,
            "stage": one.stage,
            "says": STATUS[one.status]
            + ("" if one.status == DETERMINED else f"; would help: {what_would_help(one)}")
            + ("" if one.relative is None else f" ({interval_words(*one.relative)})"),
        }
        for one in calibration.numbers
    ]
    drawn, no_plots, shown = None, "", []
    if calibration.problem is not None and calibration.after is not None:
        assert calibration.before is not None
        shown = traces(calibration.problem, calibration.before, calibration.after)
        try:
            drawn = draw(shown, shown[0])
        except ModuleNotFoundError as error:
            no_plots = what_to_install(error) or ""
            if not no_plots:
                raise
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(BREAKABLE + _PAGE).render(
        title=f"Calibration of {calibration.joint}",
        style=STYLE,
        refused=bool(calibration.refused),
        summary=sentence(calibration),
        rows=rows,
        figures=[
            (f.horizon, f.channel, *(told(x, f.unit) for x in (f.before, f.after, f.floor)))
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
