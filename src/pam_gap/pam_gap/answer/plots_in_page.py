"""A plot in an HTML file, drawn twice: for a desk, and for a phone, which cannot show that one."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure

WIDE: Final = 10.4
"""Width of a plot for a desk [in]."""
NARROW: Final = 4.2
"""Width of a plot for a phone [in]."""
_ELEMENT: Final = (
    '<picture><source media="(max-width: 700px)" srcset="data:image/svg+xml;base64,{narrow}">'
    '<img style="max-width:100%;height:auto" alt="{alt}" '
    'src="data:image/svg+xml;base64,{wide}"></picture>'
)


def is_narrow(width: float) -> bool:
    """Whether a plot of this width [in] is the one for a phone."""
    return width < 0.5 * (NARROW + WIDE)


def picture(draw: Callable[[float], Figure], alt: str, look: Any) -> str:
    """The HTML element of a plot in both widths.

    Parameters
    ----------
    draw : callable
        Draws the plot in a width [in].
    alt : str
        What it shows, for those who do not see it.
    look : mapping
        rcParams of matplotlib.
    """
    return _ELEMENT.format(
        alt=html.escape(alt), wide=_svg(draw, WIDE, look), narrow=_svg(draw, NARROW, look)
    )


def _svg(draw: Callable[[float], Figure], width: float, look: Any) -> str:
    with mpl.rc_context(look):
        buffer = io.BytesIO()
        draw(width).savefig(buffer, format="svg", metadata={"Date": None})
    return base64.b64encode(buffer.getvalue()).decode()
