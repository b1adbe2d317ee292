"""`pam sim`: a simulated rig on a CAN bus without ROS, and the tables of faults."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pam_model.argument_types import count, input_file, named_number, number
from pam_model.command_line import Arguments, Command, NodeCommand, Outcome, Parser, Tool
from pam_model.common_options import add_bus, add_dbc, add_rig

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp
    from pam_ros.parameter_row import Parameter


def _rig(given: Arguments) -> Outcome:
    from pam_sim.rig import run  # noqa: PLC0415  (numba)

    return run(given)


def _declare_rig(parser: Parser) -> None:
    from pam_sim.rig_help import OPTIONS, PARAMETERS  # noqa: PLC0415

    add_rig(parser, required=True)
    add = parser.add_argument
    add(
        "--true-rig",
        type=input_file,
        metavar="FILE",
        help="rig file with the true parameters of the plant (default: --rig)",
    )
    add(
        "--effect",
        type=named_number,
        action="append",
        default=[],
        metavar="[NAME.]EFFECT.PARAMETER=VALUE",
        help="an effect in the plant, such as coulomb_friction.torque=0.5; may be repeated",
    )
    add_bus(parser)
    add_dbc(parser)
    add(
        "--firmware",
        type=input_file,
        metavar="PROGRAM",
        help="host build of firmware/, which then runs as each valve board of this project",
    )
    add(
        "--duration", type=number("s", above=0.0), metavar="S",
        help="time after which to end (default: only at a signal) [s]",
    )  # fmt: skip
    for parameter in PARAMETERS:
        if parameter.name in OPTIONS:
            _add_option(parser, parameter)


def _add_option(parser: Parser, parameter: Parameter) -> None:
    """Add the option of a parameter that the node has, too: `--pressure-noise`."""
    default, low, high = parameter.default, parameter.low, parameter.high
    unit = "" if parameter.unit == "-" else parameter.unit
    checked: dict[str, Any] = {}  # a text is checked where it is used
    if isinstance(default, int):
        checked = {"type": count(int(low), int(high))}
    elif isinstance(default, float):
        checked = {"type": number(unit, least=low, most=high)}
    usual = f" (default: {default:g})" if isinstance(default, int | float) else ""
    parser.add_argument(
        f"--{parameter.name.replace('_', '-')}",
        default=default,
        metavar=unit.upper() or "VALUE",
        help=parameter.description + (f" [{unit}]" if unit else "") + usual,
        **checked,
    )


def _node(arguments: Sequence[str] | None) -> int:
    from pam_sim.rig_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _usage() -> NodeHelp:
    from pam_sim.rig_help import HELP  # noqa: PLC0415

    return HELP


NODE = NodeCommand(
    "node", "a simulated rig on a CAN bus, with faults to inject (a ROS node)", _node, _usage
)


COMMANDS = (
    NODE,
    Command(
        "rig",
        "run a simulated rig on a CAN bus, without ROS",
        _declare_rig,
        _rig,
        examples=(
            "pam sim rig --rig config/elbow.yaml --interface udp_multicast --channel 239.74.163.2",
        ),
    ),
)
TOOL = Tool("sim", "A simulated rig with valve boards, as a program and as a node", COMMANDS)

main = TOOL.run
rig_node = NODE.start  # `ros2 run pam_sim pam_rig`


if __name__ == "__main__":
    sys.exit(main())
