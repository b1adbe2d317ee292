"""The text that a node prints for `--help`, and the check of its command line.

The text is generated from the node's table of parameters and its topics, so that it is always up to
date. ROS silently ignores an argument that is neither `--help`, nor `--version`, nor after
`--ros-args`; here it is refused.
"""

from __future__ import annotations

import itertools
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pam_ros.parameter_row import Parameter
from pam_ros.version import version_line

MISTAKE = 2
"""Exit code after a mistake of the user."""
WIDTH = 100


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A topic or service of a node."""

    name: str  # as the node gives it to ROS; `~` is the node's own name, `<...>` a variable part
    kind: str  # type, for example "sensor_msgs/JointState"
    what: str  # its content or effect, with units


@dataclass(frozen=True, slots=True)
class NodeHelp:
    """The information that a user needs to start a node."""

    program: str  # the command, for example "pam model node"
    purpose: str  # what the node does, in plain sentences
    parameters: Sequence[Parameter]  # the node's own parameters
    other_keys: str  # describes the other keys of its parameter file; empty if there are none
    example: str  # the arguments of an example command
    # publishes, subscribes, serves: topics and services, without `/rosout` and the services for
    # parameters
    publishes: Sequence[Endpoint] = ()
    subscribes: Sequence[Endpoint] = ()
    serves: Sequence[Endpoint] = ()

    def text(self) -> str:
        """The help text."""
        lines = [
            f"usage: {self.program} --ros-args --params-file FILE [-p NAME:=VALUE ...]",
            f"       {self.program} --help | --version",
            "",
        ]
        lines += [*textwrap.wrap(self.purpose, WIDTH), ""]
        for title, endpoints in (
            ("subscribes", self.subscribes),
            ("publishes", self.publishes),
            ("serves", self.serves),
        ):
            if endpoints:
                lines += [f"{title}:"]
                for entry in endpoints:
                    lines += [f"  {entry.name}  ({entry.kind})", *_indented(entry.what)]
                lines += [""]
        lines += ["parameters:"]
        for parameter in self.parameters:
            lines += [f"  {parameter.name}  {range_text(parameter)}"]
            when = " May change while the node runs." if parameter.changeable else ""
            lines += _indented(f"{parameter.description}.{when}")
        if self.other_keys:
            before = "and " if self.parameters else ""
            lines += textwrap.wrap(
                before + self.other_keys, WIDTH, initial_indent="  ", subsequent_indent="  "
            )
        lines += ["", "example:", f"  {self.program} {self.example}", ""]
        return "\n".join(lines)

    def answer(self, arguments: Sequence[str] | None = None) -> int | None:
        """Print the help text or the version, or refuse an unknown argument.

        Parameters
        ----------
        arguments : sequence of str, optional
            Arguments of the command line; by default those of the process.

        Returns
        -------
        int or None
            Exit code if the program must end now, else None.
        """
        words = list(sys.argv[1:] if arguments is None else arguments)
        if "-h" in words or "--help" in words:
            print(self.text())
            return 0
        if "--version" in words:
            print(version_line(self.program))
            return 0
        problem = _problem_of(words)
        if problem:
            tell_mistake(f"{problem}; see {self.program} --help")
            return MISTAKE
        return None


def _problem_of(words: Sequence[str]) -> str:
    """What is wrong with a command line; empty if ROS accepts it."""
    # whoever asks for help need not wait for ROS
    from rclpy.impl.implementation_singleton import rclpy_implementation  # noqa: PLC0415
    from rclpy.utilities import remove_ros_args  # noqa: PLC0415

    for flag, name in itertools.pairwise(words):
        if flag == "--params-file" and not Path(name).is_file():
            what = "is a folder; expected a file" if Path(name).is_dir() else "no such file"
            return f"{flag} {name}: {what}"
    try:
        unknown = remove_ros_args(list(words))
    except rclpy_implementation.UnknownROSArgsError as error:
        return f"unrecognized arguments after --ros-args: {error}"
    except rclpy_implementation.RCLError as error:
        return reason_of_rcl(error)
    return f"unrecognized arguments: {' '.join(unknown)}" if unknown else ""


def reason_of_rcl(error: Exception) -> str:
    """What rcl says of an error, without the file and line of its source code."""
    return " ".join(str(error).split(", at /")[0].split())


def range_text(parameter: Parameter) -> str:
    """Default, unit and range of a parameter as text."""
    default, unit = parameter.default, "" if parameter.unit == "-" else f" {parameter.unit}"
    if isinstance(default, bool):
        return f"= {str(default).lower()}"
    if isinstance(default, str):
        return f'= "{default}"'
    low, high = parameter.low, parameter.high
    if isinstance(default, int):
        return f"= {default}{unit}, from {low:.0f} to {high:.0f}{unit}"
    return f"= {default:g}{unit}, from {low:g} to {high:g}{unit}"


def tell_mistake(text: object) -> None:
    """Print a user's mistake in the format that all tools of the suite use."""
    print(f"error: {text}", file=sys.stderr)


def _indented(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=" " * 6, subsequent_indent=" " * 6)
