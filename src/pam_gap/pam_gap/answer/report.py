"""The diagnosis as one self-contained HTML page for people; diagnosis.json is for machines.

The page begins with the answer, then shows the one figure that proves it, then details. Text from a
recording or a rig file is escaped (`html_page`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.headline import LEAST_SHOWN, headline, marginals
from pam_gap.answer.html_page import breakable, html_page
from pam_gap.answer.page_style import VERDICT_COLOURS, VERDICT_WORDS
from pam_gap.answer.plots_in_page import picture
from pam_gap.answer.report_figures import draw_ranking, draw_shrinkage, draw_stages
from pam_gap.answer.report_words import (
    closed_words,
    delay_words,
    error_words,
    leftover_words,
    legend_words,
    ranking_words,
    shrinkage_words,
    stage_words,
)
from pam_gap.answer.traces import (
    NO_FIGURES,
    RETUNED,
    WITH_ANSWER,
    Trace,
    draw,
    drawn_or_reason,
)
from pam_gap.answer.user_units import as_probability, percent, spoken, told
from pam_gap.inference.probabilities import NONE, UNKNOWN
from pam_gap.prediction.channel_order import UNITS
from pam_gap.prediction.problem import PredictionProblem
from pam_model.effects import EFFECTS

HINT: Final = 0.3
"""Probability from which the first lines of the page name a cause that is not in the answer."""
_BODY = """
<div class="verdict" style="--verdict: {{ colour }}"><b>{{ word }}</b>{{ headline }}
{% if stated %}<small>Probability: {{ stated }}{% if rivals %}; not named, but possible:
{{ rivals }}{% endif %}</small>{% endif %}</div>

{% if drawn.parts %}<figure class="plot" aria-label="Error of the prediction of
{{ first.channel }} over the whole recording: {{ headline_words }}">
<b>{{ first.channel }}: predicted minus measured</b>{{ drawn.parts[0] | safe }}
<figcaption>{{ headline_words }} {{ legend }} {{ band }}Drag over a part
to enlarge it; the circular arrow shows all again; a click on a name in the legend hides its
curve.</figcaption>
</figure><noscript><p>The traces need JavaScript, which is in this page itself.</p></noscript>
{% elif no_figures %}<p class="quiet">There are no traces here: {{ no_figures }}.</p>{% endif %}

<p>{{ d.sentence }}{% if closed %} {{ closed }}{% endif %}</p>
{% if d.preferred %}<p>{{ d.preferred }}</p>{% endif %}
{% if leftover %}<p><b>What is left.</b> {{ leftover }}</p>{% endif %}
<p><b>What to record next.</b>
{{ d.next_experiment or ('Nothing is proposed for a cause that is named.' if rivals else
'This verdict needs no further experiment.') }}</p>
{% if improved_rig %}<p><b>What to use.</b> The
{{ 'improved' if d.effects else 're-tuned' }} rig file is
<code>{{ improved_rig }}</code>. Simulation, model node and controller can read it in place of
your rig file.{% if not d.effects %} It contains no effect, only numbers that were changed
within their tolerance.{% endif %}</p>{% endif %}

{% if causes %}<h2>How probable each cause is</h2>
<div class="wide" tabindex="0"><table class="bars">
<tr><th>cause</th><th class="n">probability</th><td></td></tr>
{% for name, share in causes %}
<tr><td>{{ name | spoken }}</td><td class="n">{{ as_probability(share) }}</td>
<td class="bar"><span style="width: {{ '%.1f' % ([100.0 * share, 100.0] | min) }}%"></span></td>
</tr>
{% endfor %}</table></div>
<p class="quiet">The probability of a cause, alone or together with others; a rig may have several
causes, so that the sum can exceed 100&nbsp;%. &ldquo;Unknown&rdquo; is a cause that is not in the
table of effects; &ldquo;none&rdquo; is an ordinary good rig. How far such numbers can be trusted
was measured on simulated rigs.</p>
<details><summary>Which sets of causes these probabilities come from</summary>
{{ table(['exactly these causes', '#share'], explanations) }}
<p class="quiet">These explanations exclude each other, and their shares add up to 100 %. The
probability of a cause is the sum over all sets that contain it.</p></details>{% endif %}

{% if sizes %}<h2>How large the gap is</h2>
{{ table(['channel', '#range', '#error as written', '#re-tuned', '#with the answer', '#limit',
'does it matter?'], sizes) }}
<p class="quiet">RMS errors of predictions on held-out data, without the part that noise causes.
Re-tuned: the numbers of the rig file changed within their tolerance, without any effect. An error
below the limit, {{ limit }} of the range, does not matter; of what no effect explains, up to
{{ limit_unexplained }} does not.</p>{% endif %}

{% if parameters %}<h2>What was found</h2>
{{ table(['effect', 'parameter', '#value', '#90 % interval', 'unit'], parameters) }}{% endif %}

{% if stages %}<h2>Where the gap arises</h2>
<figure>{{ stages | safe }}
<figcaption>{{ stage_words }} Each stage is simulated from its measured
inputs.</figcaption></figure>
{% for s in d.stages if s.note %}<p class="quiet">{{ s.stage }}: {{ s.note }}</p>{% endfor %}
{% if delays %}<p class="quiet">sensing: {{ delays }}</p>{% endif %}
{% if regimes %}<p>The gap is largest in these regimes of the motion:
{% for name, part in regimes %}{{ name }} ({{ '%.1f' % part }} times
the average squared error){{ ', ' if not loop.last }}{% endfor %}.</p>{% endif %}{% endif %}

{% if ranking %}<h2>Which effect explains the gap</h2>
<figure>{{ ranking | safe }}
<figcaption>{{ ranking_words }} Best first, by the sum of the logarithms of the errors of all
channels, so that a channel with small errors counts as well. The shares are of the RMS error of all
together.</figcaption></figure>{% endif %}
{% if d.indistinguishable %}
<p>This recording cannot distinguish:
{% for group in d.indistinguishable %}<br>{{ group | map('spoken') | join(', ') }}
{% endfor %}</p>
{% endif %}

{% if shrinkage %}<h2>How far the gap closes</h2>
<figure>{{ shrinkage | safe }}
<figcaption>{{ shrinkage_words }}</figcaption></figure>{% endif %}
{% if horizons %}{{ table(['channel', 'horizon', '#as written', '#with the answer', '#noise alone'],
horizons) }}{% endif %}

{% if drawn.parts %}<h2>Measured and predicted</h2>
{% for trace in traces %}<figure class="plot"><b>{{ trace.channel }}: measured and predicted</b>
{{ drawn.parts[2 * loop.index0 + 1] | safe }}
<figcaption>The nearer a coloured curve stays to the grey one, the better it predicts this
channel.</figcaption></figure>
<figure class="plot"><b>{{ trace.channel }}: predicted minus measured</b>
{{ drawn.parts[2 * loop.index0 + 2] | safe }}
<figcaption>{{ trace_words[loop.index0] }}</figcaption></figure>{% endfor %}{% endif %}

<h2>The data</h2>
<ul>{% for r in d.repairs %}<li>{{ r }}</li>{% else %}<li>The recordings needed no repair.</li>
{% endfor %}{% for r in d.left_out %}<li>Not available: {{ r }}</li>{% endfor %}
{% if d.not_shown %}<li>At their usual size, these effects would stay below the noise
in this recording, which therefore can neither show nor exclude them:
{{ d.not_shown | map('spoken') | join(', ') }}.</li>{% endif %}</ul>
<h2>Where this answer comes from</h2>
{{ table([], origin, 'origin') }}
"""


def _blamed_stages(diagnosis: Mapping[str, Any]) -> set[str]:
    """The stages of all effects of the answer; without effects, that of the largest gap."""
    named: set[str] = {EFFECTS[effect].stage for effect in diagnosis["effects"]}
    return named or ({diagnosis["stage"]} if diagnosis["stage"] else set())


def _explanations(found: Mapping[str, float]) -> list[tuple[str, str]]:
    """The explanations that exclude each other; those below `LEAST_SHOWN` in one row."""
    shown = {spoken(name): p for name, p in found.items() if p >= LEAST_SHOWN}
    rest = sum(found.values()) - sum(shown.values())
    if rest >= LEAST_SHOWN:
        shown[f"{len(found) - len(shown)} others together"] = rest
    return [(name, as_probability(p)) for name, p in shown.items()]


def _headline(traces: Sequence[Trace], channels: Mapping[str, Any], named: bool) -> Trace | None:
    """The trace of the channel that the verdict speaks of."""

    def share(trace: Trace) -> float:
        size = channels.get(trace.channel)
        if not size:
            return 0.0
        return float(size["before" if named else "retuned"]) / max(float(size["motion"]), 1e-300)

    return max(traces, key=share, default=None)


def _size_row(channel: str, size: Mapping[str, Any]) -> tuple[str, ...]:
    unit = str(size["unit"])
    told_sizes = (told(size[key], unit) for key in ("before", "retuned", "after", "limit"))
    return (breakable(channel), told(size["motion"], unit, 3), *told_sizes, _matters(size))


def parameter_rows(parameters: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Effect, parameter, value, 90 % interval and unit of what diagnosis.json says was found."""
    return [
        (spoken(effect), spoken(name), f"{p['value']:.4g}", f"{p['low']:.4g} to {p['high']:.4g}",
         p["unit"])
        for effect, found in parameters.items()
        for name, p in found.items()
    ]  # fmt: skip


def _matters(size: Mapping[str, float]) -> str:
    limit = size["limit"]
    if max(size["before"], size["retuned"]) <= limit:
        return "no"
    if size["after"] <= size["limit_unexplained"]:
        return "yes; what is left does not"
    if size["after"] <= size.get("background", 0.0):
        return "yes; what is left is ordinary"
    return "yes, also what is left"


def _origin(found: Mapping[str, Any] | None, facts: Mapping[str, float]) -> list[tuple[str, str]]:
    rows = []
    if found:
        files = [("rig file", found["rig"]), *(("recording", r) for r in found["recordings"])]
        rows = [(name, f"{f['path']} (SHA-256 {f['sha256'][:16]}…)") for name, f in files]
        if found["command"]:
            rows.append(("command", found["command"]))
        rows.append(("versions", ", ".join(f"{n} {v}" for n, v in found["versions"].items())))
        rows.append(("date", found["date"]))
    return [
        *rows,
        ("simulations of the recording", f"{facts.get('simulations', 0):.0f}"),
        ("time", f"{facts.get('seconds', 0):.1f} s"),
    ]


def _probable(found: Sequence[tuple[str, float]]) -> str:
    return ", ".join(f"{spoken(effect)} {as_probability(p)}" for effect, p in found)


def render(
    diagnosis: Mapping[str, Any], answer_line: str, traces: Sequence[Trace], improved_rig: str = ""
) -> str:
    """Return the page as text.

    Parameters
    ----------
    diagnosis : mapping
        The content of diagnosis.json.
    traces : sequence of Trace
        The channels of a recording.
    improved_rig : str
        Name of the improved or re-tuned rig file; empty if there is none.
    """
    d = diagnosis
    verdict, named = str(d["verdict"]), list(d["effects"])
    channels = d["materiality"]["channels"]
    causes = marginals(d["probabilities"])
    first = _headline(traces, channels, bool(named))
    drawn, no_figures = NO_FIGURES, ""
    if first is not None:
        drawn, no_figures = drawn_or_reason(partial(draw, traces, first))
    blamed = _blamed_stages(d)
    answer = WITH_ANSWER if named else RETUNED
    has_shrinkage = bool(d["gap"]) and verdict != "not_identifiable"
    return html_page(
        f"Diagnosis of {d['joint']}",
        _BODY,
        script=drawn.script,
        d=d,
        headline=answer_line,
        improved_rig=improved_rig,
        traces=traces,
        percent=percent,
        as_probability=as_probability,
        colour=VERDICT_COLOURS.get(verdict, "#6b7280"),
        word=VERDICT_WORDS.get(verdict, verdict),
        stated=_probable([cause for cause in causes if cause[0] in named]),
        rivals=_probable(
            [(e, p) for e, p in causes if named and p >= HINT and e not in {*named, NONE, UNKNOWN}]
        ),
        closed=closed_words(d["closed"]) if named else "",
        drawn=drawn,
        no_figures=no_figures,
        first=first,
        legend=legend_words(first) if first is not None else "",
        headline_words=error_words(first, channels) if first is not None else "",
        band=f"In the grey band, ± {told(first.limit, first.unit)}, an error does not matter. "
        if first is not None and first.limit > 0.0
        else "",
        causes=causes,
        explanations=_explanations(d["probabilities"]),
        leftover=leftover_words(d["leftover"], verdict),
        sizes=[_size_row(channel, size) for channel, size in channels.items()],
        limit=percent(d["materiality"]["limit"]),
        limit_unexplained=percent(d["materiality"]["limit_unexplained"]),
        parameters=parameter_rows(d["parameters"]),
        stages=picture(
            partial(draw_stages, d["stages"], blamed),
            "The chain of stages from valve to sensing, with the error of each as a multiple of "
            "its noise",
            {},
        )
        if d["stages"]
        else "",
        stage_words=stage_words(blamed, verdict),
        delays=delay_words(d["delays"]),
        regimes=[(name, share) for name, share in list(d["regimes"].items())[:4] if share > 1.1],
        ranking=picture(
            partial(draw_ranking, d["ranking"], named),
            "Share of the gap that each candidate leaves, with intervals",
            {},
        )
        if d["ranking"]
        else "",
        ranking_words=ranking_words(d["ranking"]) if d["ranking"] else "",
        shrinkage=picture(
            partial(draw_shrinkage, d["gap"], answer),
            "Error of each channel over its noise floor, as written and with the answer",
            {},
        )
        if has_shrinkage
        else "",
        shrinkage_words=shrinkage_words(d["gap"], answer) if has_shrinkage else "",
        trace_words=[error_words(trace, channels) for trace in traces],
        horizons=[
            (breakable(f["channel"]), f["horizon"],
             *("-" if f[key] is None else told(f[key], f["unit"])
               for key in ("before", "after", "floor")))
            for f in d["horizons"]
        ],
        origin=_origin(d["provenance"], d["facts"]),
    )  # fmt: skip


def traces_of(problem: PredictionProblem, diagnosis: Diagnosis) -> list[Trace]:
    """Measured, nominal and improved predictions of the first recording."""
    known = [diagnosis.written_values, diagnosis.improved_values]
    if diagnosis.closest_values is not None:
        known.append(diagnosis.closest_values)
    vectors = np.array(known)
    errors = problem.errors(vectors)[:, : problem.offsets[1]]
    data = problem.data[0]
    rows = errors.shape[1]
    time = problem.row_time[:rows]
    has_answer = diagnosis.verdict != "not_identifiable"
    limits = {size.channel: size.limit for size in diagnosis.sizes}
    traces = []
    for c in np.nonzero(problem.present)[0]:
        measured = data.rows(data.measured[:, c])
        predicted = measured - errors[:, :, c] * data.block_deviation[c]
        traces.append(
            Trace(
                channel=problem.names[c],
                unit=UNITS[c],
                time=time,
                measured=measured,
                nominal=predicted[0],
                improved=predicted[1] if has_answer else None,
                closest=predicted[2] if len(known) > 2 else None,
                closest_name=" + ".join(diagnosis.ranking[0].effects) if diagnosis.ranking else "",
                improved_name=WITH_ANSWER if diagnosis.effects else RETUNED,
                limit=limits.get(problem.names[c], 0.0),
            )
        )
    return traces


def write_report(
    path: Path, problem: PredictionProblem, diagnosis: Diagnosis, improved_rig: str
) -> None:
    """Write the page of a diagnosis, with traces along the first recording."""
    with mpl.rc_context({"svg.fonttype": "none", "font.size": 9}):
        page = render(
            diagnosis.to_json(), headline(diagnosis), traces_of(problem, diagnosis), improved_rig
        )
    path.write_text(page, encoding="utf-8")
