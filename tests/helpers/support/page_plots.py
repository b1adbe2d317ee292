"""The plots of a page: Bokeh draws none of them if one has no place on the page."""

from __future__ import annotations

import json
import re


def plots_and_missing_places(page: str) -> tuple[int, list[str]]:
    """The number of plots that a page's script draws, and the places that the page lacks."""
    wanted = [
        place
        for roots in re.findall(r'"roots":(\{[^{}]*\})', page)
        for place in json.loads(roots).values()
        if isinstance(place, str)
    ]
    return len(wanted), [place for place in wanted if f'id="{place}"' not in page]
