"""The controller's parameters as a parameter file with comments, such as config/controller.yaml.

It is made from the declarations, with those of installed control laws.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from pam_control.declared import Declared, Value
from pam_control.node_parameters import declared_parameters

WIDTH: Final = 100
EACH_JOINT: Final = "<joint>"
OF_HOST: Final = ("loop.realtime_priority", "loop.align", "loop.command_delay")
"""Set for a host, often on the command line; a section of a file would have precedence over it."""
_HEAD: Final = """\
# The controller's parameters with their defaults; give it to the node together with a rig file.
# Made by `./pam control parameters`. Changeable while running (ros2 param set /pam_controller ...),
# unless marked "start".
/**/pam_controller:
  ros__parameters:
"""


def as_yaml(value: Value) -> str:
    """A value in YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    return '""' if value == "" else str(value)


def _lines(parameters: Sequence[Declared], depth: int, indent: str) -> Iterator[str]:
    """The lines of parameters whose names agree in their first `depth` parts."""
    for part, members in groupby(parameters, lambda each: each.key.split(".")[depth]):
        group = list(members)
        first = group[0]
        if first.key.count(".") == depth:
            unit = f"{first.unit}, " if first.unit != "-" else ""
            start = "start; " if first.fixed else ""
            width = WIDTH - len(indent) - 2
            for line in textwrap.wrap(f"{unit}{start}{first.description}", width):
                yield f"{indent}# {line}"
            off = "# " if first.key in OF_HOST else ""
            yield f"{indent}{off}{part}: {as_yaml(first.default)}"
        else:
            yield f"{indent}{part}:"
            yield from _lines(group, depth + 1, indent + "  ")


def yaml_text() -> str:
    """A parameter file with all defaults; the parameters of single joints are comments."""
    parameters = declared_parameters((EACH_JOINT,))
    common = [each for each in parameters if EACH_JOINT not in each.key]
    single = [each for each in parameters if EACH_JOINT in each.key]
    lines = list(_lines(common, 0, "    "))
    lines += ["    # Of single joints, by name; those of one group belong together:"]
    lines += [f"    # {line}" for line in _lines(single, 0, "")]
    return _HEAD + "\n".join(lines) + "\n"
