"""A diagnosis in a notebook: its sentence, and its numbers as tables."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_gap.answer.user_units import spoken, told

if TYPE_CHECKING:
    import pandas as pd

NumberRow = tuple[str, str, float, float, float, str]
"""Effect, parameter, value, both ends of the 90 % interval, unit."""
GapRow = tuple[str, float, float, float, str]
"""Channel, RMS error before and after, noise, unit."""


def as_frame(rows: Sequence[NumberRow]) -> pd.DataFrame:
    """The numbers of the named effects, indexed by effect and parameter; may be empty."""
    import pandas as pd  # noqa: PLC0415  (takes half a second)

    columns = ["effect", "parameter", "value", "low", "high", "unit"]
    return pd.DataFrame(rows, columns=columns).set_index(["effect", "parameter"])


def as_html(title: str, sentence: str, numbers: Sequence[NumberRow], gaps: Sequence[GapRow]) -> str:
    """The verdict, the numbers of what it names, and the gap of each channel, as HTML.

    Parameters
    ----------
    title, sentence : str
        Joint and verdict, and the answer in words.
    numbers, gaps : sequence of tuple
        Rows of both tables.
    """
    parts = [f"<p><b>{html.escape(title)}</b><br>{html.escape(sentence)}</p>"]
    if numbers:
        rows = [
            (spoken(effect), spoken(name), *(told(at, unit, 3) for at in found))
            for effect, name, *found, unit in numbers
        ]
        parts.append(_table(("effect", "parameter", "value", "90 % from", "to"), rows))
    if gaps:
        rows = [(name, *(told(at, unit) for at in found)) for name, *found, unit in gaps]
        parts.append(_table(("channel", "gap before", "after", "noise"), rows))
    return "".join(parts)


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = ["".join(f"<th>{html.escape(one)}</th>" for one in head)]
    lines += ["".join(f"<td>{html.escape(one)}</td>" for one in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
