"""The frame of every page: head, style and title, and the tables that they are made of.

Text from a recording or a rig file is escaped (Jinja2 autoescape).
"""

from __future__ import annotations

from html import escape
from typing import Any, Final

import jinja2
from jinja2.filters import do_mark_safe

from pam_gap.answer.page_style import STYLE
from pam_gap.answer.user_units import spoken

_FRAME: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title>
<style>{{ style | safe }}</style></head><body><main>
<h1>{{ title }}</h1>
{% include "body" %}
</main>
{{ script | safe }}
</body></html>
"""
_TABLE: Final = """{% macro look_of(name) %}{% if name.startswith('#') %} class="n"{% endif %}
{%- endmacro %}
{% macro table(head, rows, look='') %}
<div class="wide" tabindex="0"><table{% if look %} class="{{ look }}"{% endif %}>
{% if head %}<tr>{% for name in head %}<th{{ look_of(name) }}>{{ name.lstrip('#') }}</th>
{%- endfor %}</tr>{% endif %}
{% for row in rows %}<tr>{% for cell in row %}<td{{ look_of(head[loop.index0] if head else '') }}>
{{- cell }}</td>{% endfor %}</tr>
{% endfor %}</table></div>{% endmacro %}"""


def breakable(name: str) -> str:
    """A name of a channel, which may be broken where its parts meet."""
    return do_mark_safe(escape(name).replace(".", ".<wbr>").replace("_", "_<wbr>"))


def marked_up(html: str, *words: object) -> str:
    """A cell with HTML of its own, in which every {} takes one of the words."""
    return do_mark_safe(html).format(*words)


def html_page(title: str, body: str, *, style: str = "", script: str = "", **values: Any) -> str:
    """A page as text.

    Parameters
    ----------
    title : str
        Title and headline.
    body : str
        Jinja2 template of what stands below it. `table(head, rows)` in it makes a table of lists
        of cells, in which a name of the head that begins with # marks a column of numbers.
    style : str
        CSS in addition to that of all pages.
    script : str
        HTML behind the page, such as the scripts of its plots.
    **values
        What the body names.
    """
    environment = jinja2.Environment(
        loader=jinja2.DictLoader({"frame": _FRAME, "body": _TABLE + body}),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["spoken"] = spoken
    return environment.get_template("frame").render(
        title=title, style=STYLE + style, script=script, **values
    )
