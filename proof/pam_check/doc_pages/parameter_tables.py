"""The tables of parameters, generated from their declarations."""

from __future__ import annotations

from pam_check.doc_pages.markdown import table
from pam_control.node_parameters import declared_parameters
from pam_control.parameter_file import EACH_JOINT, as_yaml
from pam_driver.driver_parameters import TABLE as DRIVER_PARAMETERS


def controller_parameters_table() -> str:
    """The parameters of the controller, with those of installed control laws."""
    rows = []
    for each in declared_parameters((EACH_JOINT,)):
        is_number = type(each.default) in (int, float)
        bounds = f"{each.unit}; {each.low:g}, {each.high:g}" if is_number else each.unit
        start = "read at the start: " if each.fixed else ""
        meaning = start + each.description.replace(EACH_JOINT, "a joint")
        rows.append((f"`{each.key}`", f"`{as_yaml(each.default)}`", bounds, meaning))
    return table(("parameter", "default", "unit; from, to", "meaning"), rows)


def driver_parameters_table() -> str:
    """The parameters of the driver's node."""
    rows = []
    for each in DRIVER_PARAMETERS:
        is_number = type(each.default) in (int, float)
        default = f"{each.default:.15g}" if is_number else as_yaml(each.default)
        if isinstance(each.default, str):
            default = f'`"{each.default}"`'
        bounds = f"{each.low:g} to {each.high:g}" if is_number else ""
        rows.append((f"`{each.name}`", default, each.unit, bounds, each.description))
    return table(("parameter", "default", "unit", "range", "meaning"), rows)
