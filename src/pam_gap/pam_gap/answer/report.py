"""The diagnosis as one self-contained HTML page for people; diagnosis.json is for machines.

The page begins with the answer, then shows the one figure that proves it, then details. Text from a
recording or a rig file is escaped (Jinja2 autoescape).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import jinja2
import matplotlib as mpl

from pam_gap.answer.headline import LEAST_SHOWN, marginals
from pam_gap.answer.page_style import BREAKABLE, STYLE, VERDICT_COLOURS, VERDICT_WORDS
from pam_gap.answer.plots_in_page import picture
from pam_gap.answer.report_figures import (
    RankedCandidate,
    StageBar,
    draw_ranking,
    draw_shrinkage,
    draw_stages,
)
from pam_gap.answer.report_words import (
    closed_words,
    error_words,
    leftover_words,
    legend_words,
    ranking_words,
    shrinkage_words,
    stage_words,
)
from pam_gap.answer.traces import RETUNED, WITH_ANSWER, Trace, draw
from pam_gap.answer.user_units import percent, spoken, told
from pam_gap.inference.probabilities import NONE, UNKNOWN
from pam_model.effects import EFFECTS
from pam_ros.missing_packages import what_to_install

__all__ = ["RankedCandidate", "ReportData", "StageBar", "Trace", "render", "write_report"]


@dataclass(frozen=True)
class ReportData:
    """Everything that the page shows."""

    title: str
    headline: str
    """The answer in one line."""
    verdict_sentence: str
    diagnosis: Mapping[str, Any]
    """The content of diagnosis.json."""
    stages: Sequence[StageBar]
    regimes: Sequence[tuple[str, float]]
    """Regime of the motion, and its squared error relative to the average."""
    traces: Sequence[Trace]
    ranking: Sequence[RankedCandidate]
    horizons: Sequence[tuple[str, str, float, float, float, str]]
    """Horizon, channel, before, after, floor, unit."""
    repairs: Sequence[str]
    left_out: Sequence[str]
    improved_rig: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)


HINT: Final = 0.3
"""Probability from which the first lines of the page name a cause that is not in the answer."""
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ d.title }}</title>
<style>
{{ style | safe }}</style></head><body><main>
<h1>{{ d.title }}</h1>
<div class="verdict" style="--verdict: {{ colour }}"><b>{{ word }}</b>{{ d.headline }}
{% if stated %}<small>Probability: {{ stated }}{% if rivals %}; not named, but possible:
{{ rivals }}{% endif %}</small>{% endif %}</div>

{% if drawn %}<figure class="plot" aria-label="Error of the prediction of
{{ first.channel }} over the whole recording: {{ headline_words }}">
<b>{{ first.channel }}: predicted minus measured</b>{{ drawn.parts[0] | safe }}
<figcaption>{{ headline_words }} {{ legend }} {{ band }}Drag over a part
to enlarge it; the circular arrow shows all again; a click on a name in the legend hides its
curve.</figcaption>
</figure><noscript><p>The traces need JavaScript, which is in this page itself.</p></noscript>
{% elif no_figures %}<p class="quiet">There are no traces here: {{ no_figures }}.</p>{% endif %}

<p>{{ d.verdict_sentence }}{% if closed %} {{ closed }}{% endif %}</p>
{% if diagnosis.get('preferred') %}<p>{{ diagnosis.preferred }}</p>{% endif %}
{% if leftover %}<p><b>What is left.</b> {{ leftover }}</p>{% endif %}
<p><b>What to record next.</b>
{{ diagnosis.next_experiment or ('Nothing is proposed for a cause that is named.' if rivals else
'This verdict needs no further experiment.') }}</p>
{% if d.improved_rig %}<p><b>What to use.</b> The
{{ 'improved' if diagnosis.effects else 're-tuned' }} rig file is
<code>{{ d.improved_rig }}</code>. Simulation, model node and controller can read it in place of
your rig file.{% if not diagnosis.effects %} It contains no effect, only numbers that were changed
within their tolerance.{% endif %}</p>{% endif %}

{% if causes %}<h2>How probable each cause is</h2>
<div class="wide" tabindex="0"><table class="bars">
<tr><th>cause</th><th class="n">probability</th><td></td></tr>
{% for p in causes %}<tr><td>{{ p.name }}</td><td class="n">{{ p.words }}</td>
<td class="bar"><span style="width: {{ '%.1f' % p.width }}%"></span></td></tr>
{% endfor %}</table></div>
<p class="quiet">The probability of a cause, alone or together with others; a rig may have several
causes, so that the sum can exceed 100&nbsp;%. &ldquo;Unknown&rdquo; is a cause that is not in the
table of effects; &ldquo;none&rdquo; is an ordinary good rig. How far such numbers can be trusted
was measured on simulated rigs.</p>
<details><summary>Which sets of causes these probabilities come from</summary>
<div class="wide" tabindex="0"><table>
<tr><th>exactly these causes</th><th class="n">share</th></tr>
{% for p in explanations %}<tr><td>{{ p.name }}</td><td class="n">{{ p.words }}</td></tr>
{% endfor %}</table></div>
<p class="quiet">These explanations exclude each other, and their shares add up to 100 %. The
probability of a cause is the sum over all sets that contain it.</p></details>{% endif %}

{% if sizes %}<h2>How large the gap is</h2>
<div class="wide" tabindex="0"><table>
<tr><th>channel</th><th class="n">range</th><th class="n">error as written</th>
<th class="n">re-tuned</th><th class="n">with the answer</th><th class="n">limit</th>
<th>does it matter?</th></tr>
{% for s in sizes %}<tr><td>{{ breakable(s.channel) }}</td><td class="n">{{ s.motion }}</td>
<td class="n">{{ s.before }}</td><td class="n">{{ s.retuned }}</td><td class="n">{{ s.after }}</td>
<td class="n">{{ s.limit }}</td><td>{{ s.matters }}</td></tr>
{% endfor %}</table></div>
<p class="quiet">RMS errors of predictions on held-out data, without the part that noise causes.
Re-tuned: the numbers of the rig file changed within their tolerance, without any effect. An error
below the limit, {{ limit }} of the range, does not matter; of what no effect explains, up to
{{ limit_unexplained }} does not.</p>{% endif %}

{% if diagnosis.parameters %}<h2>What was found</h2>
<div class="wide" tabindex="0"><table>
<tr><th>effect</th><th>parameter</th><th class="n">value</th><th class="n">90 % interval</th>
<th>unit</th></tr>
{% for effect, parameters in diagnosis.parameters.items() %}
{% for name, p in parameters.items() %}
<tr><td>{{ effect | spoken }}</td><td>{{ name | spoken }}</td>
<td class="n">{{ '%.4g' % p.value }}</td>
<td class="n">{{ '%.4g' % p.low }} to {{ '%.4g' % p.high }}</td><td>{{ p.unit }}</td></tr>
{% endfor %}{% endfor %}</table></div>{% endif %}

{% if d.stages %}<h2>Where the gap arises</h2>
<figure>{{ stages | safe }}
<figcaption>{{ stage_words }} Each stage is simulated from its measured
inputs.</figcaption></figure>
{% for s in d.stages if s.note %}<p class="quiet">{{ s.stage }}: {{ s.note }}</p>{% endfor %}
{% if d.regimes %}<p>The gap is largest in these regimes of the motion:
{% for name, part in d.regimes %}{{ name }} ({{ '%.1f' % part }} times
the average squared error){{ ', ' if not loop.last }}{% endfor %}.</p>{% endif %}{% endif %}

{% if ranking %}<h2>Which effect explains the gap</h2>
<figure>{{ ranking | safe }}
<figcaption>{{ ranking_words }} Best first, by the sum of the logarithms of the errors of all
channels, so that a channel with small errors counts as well. The shares are of the RMS error of all
together.</figcaption></figure>{% endif %}
{% if diagnosis.indistinguishable %}
<p>This recording cannot distinguish:
{% for group in diagnosis.indistinguishable %}<br>{{ group | map('spoken') | join(', ') }}
{% endfor %}</p>
{% endif %}

{% if diagnosis.gap and shrinkage %}<h2>How far the gap closes</h2>
<figure>{{ shrinkage | safe }}
<figcaption>{{ shrinkage_words }}</figcaption></figure>{% endif %}
{% if horizons %}<div class="wide" tabindex="0"><table>
<tr><th>channel</th><th>horizon</th><th class="n">as written</th><th class="n">with the answer</th>
<th class="n">noise alone</th></tr>
{% for h, channel, before, after, floor in horizons %}
<tr><td>{{ breakable(channel) }}</td><td>{{ h }}</td><td class="n">{{ before }}</td>
<td class="n">{{ after }}</td><td class="n">{{ floor }}</td></tr>
{% endfor %}</table></div>{% endif %}

{% if drawn %}<h2>Measured and predicted</h2>
{% for trace in d.traces %}<figure class="plot"><b>{{ trace.channel }}: measured and predicted</b>
{{ drawn.parts[2 * loop.index0 + 1] | safe }}
<figcaption>The nearer a coloured curve stays to the grey one, the better it predicts this
channel.</figcaption></figure>
<figure class="plot"><b>{{ trace.channel }}: predicted minus measured</b>
{{ drawn.parts[2 * loop.index0 + 2] | safe }}
<figcaption>{{ trace_words[loop.index0] }}</figcaption></figure>{% endfor %}{% endif %}

<h2>The data</h2>
<ul>{% for r in d.repairs %}<li>{{ r }}</li>{% else %}<li>The recordings needed no repair.</li>
{% endfor %}{% for r in d.left_out %}<li>Not available: {{ r }}</li>{% endfor %}
{% if diagnosis.get('not_shown') %}<li>At their usual size, these effects would stay below the noise
in this recording, which therefore can neither show nor exclude them:
{{ diagnosis.not_shown | map('spoken') | join(', ') }}.</li>{% endif %}</ul>
<h2>Where this answer comes from</h2>
<div class="wide" tabindex="0"><table class="origin">
{% for key, value in origin %}<tr><td>{{ key }}</td><td>{{ value }}</td></tr>{% endfor %}
{% for key, value in d.facts.items() %}<tr><td>{{ key }}</td><td>{{ value }}</td></tr>
{% endfor %}</table></div>
</main>
{% if drawn %}{{ drawn.script | safe }}{% endif %}
</body></html>
"""


def _blamed_stages(diagnosis: Mapping[str, Any]) -> set[str]:
    """The stages of all effects of the answer; without effects, that of the largest gap."""
    named: set[str] = {EFFECTS[effect].stage for effect in diagnosis["effects"]}
    return named or ({diagnosis["stage"]} if diagnosis["stage"] else set())


def _rows(shown: Sequence[tuple[str, float]]) -> list[dict[str, Any]]:
    return [
        {"name": spoken(n), "words": percent(p), "width": min(100.0 * p, 100.0)} for n, p in shown
    ]


def _explanations(found: Mapping[str, float]) -> list[dict[str, Any]]:
    """The explanations that exclude each other; those below `LEAST_SHOWN` in one row."""
    shown = {name: p for name, p in found.items() if p >= LEAST_SHOWN}
    rest = sum(found.values()) - sum(shown.values())
    rows = list(shown.items())
    if rest >= LEAST_SHOWN:
        rows.append((f"{len(found) - len(shown)} others together", rest))
    return _rows(rows)


def _headline(traces: Sequence[Trace], channels: Mapping[str, Any], named: bool) -> Trace | None:
    """The trace of the channel that the verdict speaks of."""

    def share(trace: Trace) -> float:
        size = channels.get(trace.channel)
        if not size:
            return 0.0
        return float(size["before" if named else "retuned"]) / max(float(size["motion"]), 1e-300)

    return max(traces, key=share, default=None)


def _size_rows(materiality: Mapping[str, Any]) -> list[dict[str, str]]:
    rows = []
    for channel, size in materiality.get("channels", {}).items():
        unit = str(size["unit"])
        rows.append(
            {
                "channel": channel,
                "motion": told(size["motion"], unit, 3),
                **{key: told(size[key], unit) for key in ("before", "retuned", "after", "limit")},
                "matters": _matters(size),
            }
        )
    return rows


def _matters(size: Mapping[str, float]) -> str:
    limit = size["limit"]
    if max(size["before"], size["retuned"]) <= limit:
        return "no"
    if size["after"] <= size["limit_unexplained"]:
        return "yes; what is left does not"
    if size["after"] <= size.get("background", 0.0):
        return "yes; what is left is ordinary"
    return "yes, also what is left"


def _origin(found: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if not found:
        return []
    files = [("rig file", found["rig"]), *(("recording", r) for r in found["recordings"])]
    rows = [(name, f"{f['path']} (SHA-256 {f['sha256'][:16]}…)") for name, f in files]
    if found["command"]:
        rows.append(("command", found["command"]))
    rows.append(("versions", ", ".join(f"{n} {v}" for n, v in found["versions"].items())))
    rows.append(("date", found["date"]))
    return rows


def render(data: ReportData) -> str:
    """Return the page as text."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["spoken"] = spoken
    diagnosis = dict(data.diagnosis)
    verdict = str(diagnosis["verdict"])
    materiality = diagnosis.get("materiality") or {}
    channels = materiality.get("channels", {})
    named = list(diagnosis["effects"])
    probabilities = diagnosis.get("probabilities") or {}
    causes = _rows(marginals(probabilities))
    first = _headline(data.traces, channels, bool(named))
    drawn, no_figures = None, ""
    try:
        drawn = None if first is None else draw(data.traces, first)
    except ModuleNotFoundError as error:
        no_figures = what_to_install(error) or ""
        if not no_figures:
            raise
    blamed = _blamed_stages(diagnosis)
    answer = WITH_ANSWER if named else RETUNED
    has_shrinkage = bool(diagnosis["gap"]) and verdict != "not_identifiable"
    return environment.from_string(BREAKABLE + _PAGE).render(
        d=data,
        style=STYLE,
        diagnosis=diagnosis,
        colour=VERDICT_COLOURS.get(verdict, "#6b7280"),
        word=VERDICT_WORDS.get(verdict, verdict),
        stated=", ".join(
            f"{spoken(effect)} {percent(p)}"
            for effect, p in marginals(probabilities)
            if effect in named
        ),
        rivals=", ".join(
            f"{spoken(effect)} {percent(p)}"
            for effect, p in marginals(probabilities)
            if named and p >= HINT and effect not in {*named, NONE, UNKNOWN}
        ),
        closed=closed_words(diagnosis.get("closed")) if named else "",
        drawn=drawn,
        no_figures=no_figures,
        first=first,
        legend=legend_words(first) if first is not None else "",
        headline_words=error_words(first, channels) if first is not None else "",
        band=f"In the grey band, ± {told(first.limit, first.unit)}, an error does not matter. "
        if first is not None and first.limit > 0.0
        else "",
        causes=causes,
        explanations=_explanations(probabilities),
        leftover=leftover_words(diagnosis.get("leftover"), verdict),
        sizes=_size_rows(materiality),
        limit=percent(materiality.get("limit", 0.0)),
        limit_unexplained=percent(materiality.get("limit_unexplained", 0.0)),
        stages=picture(
            partial(draw_stages, data.stages, blamed),
            "The chain of stages from valve to sensing, with the error of each as a multiple of "
            "its noise",
            {},
        )
        if data.stages
        else "",
        stage_words=stage_words(blamed, verdict),
        ranking=picture(
            partial(draw_ranking, data.ranking, named),
            "Share of the gap that each candidate leaves, with intervals",
            {},
        )
        if data.ranking
        else "",
        ranking_words=ranking_words(data.ranking) if data.ranking else "",
        shrinkage=picture(
            partial(draw_shrinkage, diagnosis["gap"], answer),
            "Error of each channel over its noise floor, as written and with the answer",
            {},
        )
        if has_shrinkage
        else "",
        shrinkage_words=shrinkage_words(diagnosis["gap"], answer) if has_shrinkage else "",
        trace_words=[error_words(trace, channels) for trace in data.traces],
        horizons=[
            (h, channel, told(before, unit), told(after, unit), told(floor, unit))
            for h, channel, before, after, floor, unit in data.horizons
        ],
        origin=_origin(diagnosis.get("provenance")),
    )


def write_report(data: ReportData, path: Path) -> None:
    """Write the page to `path`."""
    with mpl.rc_context({"svg.fonttype": "none", "font.size": 9}):
        path.write_text(render(data), encoding="utf-8")
