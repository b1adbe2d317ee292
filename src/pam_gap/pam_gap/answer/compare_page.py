"""`pam gap compare`: the page, the table in the terminal, and the JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pam_gap.answer.compare import (
    Difference,
    GapRow,
    JointComparison,
    compare,
    letter,
    read_answers,
)
from pam_gap.answer.html_page import html_page, marked_up
from pam_gap.answer.page_style import VERDICT_WORDS
from pam_gap.answer.plots_in_page import is_narrow, picture
from pam_gap.answer.user_units import interval_digits, plain, spoken, told, user_unit
from pam_model.command_line import Arguments, Outcome
from pam_model.reading import reading

PAGE = "compare.html"
_COLOURS = ("#c2410c", "#00798c", "#6b46c1", "#4a5568", "#b7791f")
LOOK = {"font.size": 9}
RETUNED = "re-tuned"
HOW = (
    "A change is more than noise if it exceeds 1.96 standard deviations (z-test of the difference, "
    "5 %). Standard deviations follow from the halves of the 90 % intervals that face each other."
)

_BODY = """
<p>{% for name in names %}<b>{{ letters[loop.index0] }}</b>: {{ name }}<br>{% endfor %}</p>
{% for joint in joints %}
<h2>{{ joint.name }}</h2>
<div class="verdict" style="--verdict: {{ '#c2410c' if joint.changes else '#2f855a' }}">
<b>{{ 'Changed' if joint.changes else 'No change beyond noise' }}</b>
{% for text in joint.changes %}{{ text }}<br>{% else %}All diagnoses agree within their intervals.
{% endfor %}</div>
{% if joint.caution %}<p><b>Caution.</b> {{ joint.caution }}</p>{% endif %}
<h3>Verdicts</h3>
{% for answer in joint.answers %}<p><b>{{ letters[loop.index0] }}: {{ answer.word }}.</b>
{{ answer.sentence }}</p>{% endfor %}
{% if joint.picture %}<h3>Size of the gap</h3>
{{ joint.picture | safe }}
{{ table(['channel', 'error'] + of_numbers, joint.gaps) }}
<p class="quiet">RMS errors of predictions on held-out data, without the part that noise causes,
with the rig file of each diagnosis. They have no intervals, and depend on the motion,
too.</p>{% endif %}
{% if joint.rows %}<h3>Parameters</h3>
{{ table(['effect', 'parameter'] + of_numbers + against, joint.rows) }}
<p class="quiet">Values with their 90 % intervals. {{ how }}</p>{% endif %}
{% endfor %}
"""


def _cell(value: Mapping[str, float] | None, unit: str) -> str:
    if value is None:
        return "not named"
    size = max(abs(value[key]) for key in ("value", "low", "high"))
    name, factor = user_unit(size, unit)
    digits = interval_digits(factor * value["low"], factor * value["high"])
    low, here, high = (plain(factor * value[key], digits) for key in ("low", "value", "high"))
    return f"{here} ({low} to {high})" + ("" if name in ("", "-") else f" {name}")


def draw_gaps(gaps: Sequence[GapRow], width: float) -> Figure:
    """Draw the error of each channel as written and with the answer, in a width [in].

    The channels are next to each other or, on a phone, below each other.
    """
    rows, columns = (len(gaps), 1) if is_narrow(width) else (1, len(gaps))
    figure = Figure(figsize=(width, 0.6 + 2.2 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, row in zip(axes, gaps, strict=True):
        shown = [s for s in row.sizes if s is not None]
        unit, factor = user_unit(max(max(s["before"], s["after"]) for s in shown), row.unit)
        for key, offset, colour, label in (
            ("before", -0.2, _COLOURS[0], "rig file as written"),
            ("after", 0.2, _COLOURS[1], "with the answer"),
        ):
            heights = [math.nan if s is None else factor * s[key] for s in row.sizes]
            axis.bar(np.arange(len(heights)) + offset, heights, 0.36, color=colour, label=label)
        axis.set_xticks(range(len(row.sizes)), [letter(k) for k in range(len(row.sizes))])
        axis.set_ylabel(f"RMS error [{unit}]")
        axis.set_title(row.channel, fontsize=8)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _gap_rows(row: GapRow) -> list[tuple[str, ...]]:
    return [
        (row.channel, words, *("-" if s is None else told(s[key], row.unit) for s in row.sizes))
        for key, words in (
            ("before", "as written"), ("retuned", RETUNED), ("after", "with the answer"),
        )
    ]  # fmt: skip


def _alt(joint: JointComparison) -> str:
    parts = []
    for row in joint.gaps:
        sizes = [
            f"{letter(k)} {told(s['before'], row.unit)} as written, "
            f"{told(s['after'], row.unit)} with the answer"
            for k, s in enumerate(row.sizes) if s is not None
        ]  # fmt: skip
        parts.append(f"{row.channel}: {'; '.join(sizes)}")
    return f"Size of the gap of each channel. {'. '.join(parts)}."


def render(joints: Sequence[JointComparison], names: Sequence[str]) -> str:
    """Return the page as text; `names`: what the user called each diagnosis."""
    letters = [letter(k) for k in range(len(names))]
    return html_page(
        f"Comparison of {len(names)} diagnoses",
        _BODY,
        names=list(names),
        letters=letters,
        of_numbers=[f"#{name}" for name in letters],
        against=[f"{name} against A" for name in letters[1:]],
        how=HOW,
        joints=[
            {
                "name": joint.joint,
                "changes": joint.changes,
                "caution": joint.caution,
                "answers": [
                    {
                        "word": VERDICT_WORDS.get(a.content["verdict"], a.content["verdict"]),
                        "sentence": a.content.get("sentence", ""),
                    }
                    for a in joint.answers
                ],
                "picture": picture(partial(draw_gaps, joint.gaps), _alt(joint), LOOK)
                if joint.gaps
                else "",
                "gaps": [cells for row in joint.gaps for cells in _gap_rows(row)],
                "rows": [
                    (
                        spoken(row.effect),
                        spoken(row.parameter),
                        *(_cell(value, row.unit) for value in row.values),
                        *map(_difference, row.differences),
                    )
                    for row in joint.parameters
                ],
            }
            for joint in joints
        ],
    )


def _difference(found: Difference) -> str:
    words = marked_up("<b>{}</b>", found.words) if found.sure else found.words
    return marked_up('<div style="min-width: 11em">{}</div>', words)


def print_table(joints: Sequence[JointComparison]) -> None:
    """Print the comparison for a terminal."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console(highlight=False)
    for joint in joints:
        letters = [letter(k) for k in range(len(joint.answers))]
        table = Table(title=joint.joint, title_justify="left")
        table.add_column("", overflow="fold")
        for name in letters:
            table.add_column(name)
        for name in letters[1:]:
            table.add_column(f"{name} against A")
        blank = [""] * (len(letters) - 1)
        table.add_row("verdict", *(str(a.content["verdict"]) for a in joint.answers), *blank)
        for gap in joint.gaps:
            for channel, kind, *cells in _gap_rows(gap):
                if kind != RETUNED:
                    table.add_row(f"{channel}, {kind}", *cells, *blank)
        for row in joint.parameters:
            table.add_row(
                f"{spoken(row.effect)}, {spoken(row.parameter)}",
                *(_cell(value, row.unit) for value in row.values),
                *(d.words for d in row.differences),
            )
        console.print(table)
        for text in joint.changes or ("No change beyond noise.",):
            print(f"{joint.joint}: {text}")
        if joint.caution:
            print(f"{joint.joint}: Caution. {joint.caution}")


def _document(joints: Sequence[JointComparison]) -> list[dict[str, Any]]:
    return [
        {
            "joint": joint.joint,
            "diagnoses": [
                {
                    "file": a.name,
                    "verdict": a.content["verdict"],
                    "effects": a.content["effects"],
                    "closed": a.content.get("closed"),
                }
                for a in joint.answers
            ],
            "parameters": joint.parameters,
            "gaps": joint.gaps,
            "changes": joint.changes,
            "caution": joint.caution,
        }
        for joint in joints
    ]


def run(given: Arguments) -> Outcome:
    """Compare diagnoses; the command of `pam_gap.__main__`."""
    with reading(", ".join(map(str, given.diagnoses)), "diagnoses as `diagnose` writes them"):
        joints = compare([read_answers(path) for path in given.diagnoses])
    out = Path(given.out)
    out.mkdir(parents=True, exist_ok=True)
    page = render(joints, [str(path) for path in given.diagnoses])
    (out / PAGE).write_text(page, encoding="utf-8")
    print_table(joints)
    print(f"written: {out / PAGE}")
    changes = [f"{joint.joint}: {text}" for joint in joints for text in joint.changes]
    return Outcome({"out": out, "joints": _document(joints)}, changes)
