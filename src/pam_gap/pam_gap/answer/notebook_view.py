"""A diagnosis in a notebook: its sentence, and its numbers as tables."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from pam_gap.answer.user_units import spoken, told

if TYPE_CHECKING:
    import pandas as pd

    from pam_gap.answer.diagnosis import Diagnosis


def numbers_of(answer: Diagnosis) -> pd.DataFrame:
    """The parameters of the named effects, one a row: value, low and high of 90 %, unit.

    Parameters
    ----------
    answer : Diagnosis
        The answer for one joint.

    Returns
    -------
    DataFrame
        Indexed by effect and parameter; empty if nothing is named.
    """
    import pandas as pd  # noqa: PLC0415  (takes half a second)

    rows = [
        (effect, name, found.interval.value, found.interval.low, found.interval.high, found.unit)
        for effect, numbers in answer.parameters.items()
        for name, found in numbers.items()
    ]
    columns = ["effect", "parameter", "value", "low", "high", "unit"]
    return pd.DataFrame(rows, columns=columns).set_index(["effect", "parameter"])


def as_html(answer: Diagnosis) -> str:
    """The verdict, the numbers of what it names, and the gap of each channel, as HTML."""
    parts = [
        f"<p><b>{html.escape(answer.joint)}: {html.escape(answer.verdict)}</b><br>"
        f"{html.escape(answer.sentence)}</p>"
    ]
    rows = [
        (spoken(effect), spoken(name), *(
            told(at, found.unit, 3)
            for at in (found.interval.value, found.interval.low, found.interval.high)
        ))
        for effect, numbers in answer.parameters.items()
        for name, found in numbers.items()
    ]  # fmt: skip
    if rows:
        parts.append(_table(("effect", "parameter", "value", "90 % from", "to"), rows))
    gaps = [
        (spoken(name), *(told(at, gap.unit) for at in (gap.before, gap.after, gap.floor)))
        for name, gap in answer.gap.items()
    ]
    if gaps:
        parts.append(_table(("channel", "gap before", "after", "noise"), gaps))
    return "".join(parts)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = ["".join(f"<th>{html.escape(one)}</th>" for one in head)]
    lines += ["".join(f"<td>{html.escape(one)}</td>" for one in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
