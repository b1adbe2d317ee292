"""The table of the controller's parameters, generated from their declarations."""

from __future__ import annotations

from pam_check.doc_pages.markdown import table
from pam_control.node_parameters import declared_parameters
from pam_control.parameter_file import EACH_JOINT, as_yaml


def parameters_table() -> str:
    """All parameters, with those of installed control laws."""
    rows = []
    for each in declared_parameters((EACH_JOINT,)):
        is_number = type(each.default) in (int, float)
        bounds = f"{each.unit}; {each.low:g}, {each.high:g}" if is_number else each.unit
        start = "read at the start: " if each.fixed else ""
        meaning = start + each.description.replace(EACH_JOINT, "a joint")
        rows.append((f"`{each.key}`", f"`{as_yaml(each.default)}`", bounds, meaning))
    return table(("parameter", "default", "unit; from, to", "meaning"), rows)
