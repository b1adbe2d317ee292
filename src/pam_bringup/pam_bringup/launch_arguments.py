"""The arguments of the launch files, each declared once."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final, NamedTuple

_YES_NO: Final = ("true", "false")


class Argument(NamedTuple):
    """An argument: its default, what it means, and what it may be, if not anything."""

    default: str
    text: str
    choices: tuple[str, ...] = ()


ARGUMENTS: Final[Mapping[str, Argument]] = {
    "rig_file": Argument("", "rig file of the robot"),
    "namespace": Argument("", "namespace of all nodes and topics; one for each robot on a network"),
    "one_process": Argument(
        "true",
        "driver, controller and model share one process and one cycle; false: three processes, "
        "which exchange topics",
        _YES_NO,
    ),
    "bus_interface": Argument("socketcan", "python-can's name of the interface"),
    "bus_channel": Argument("can0", "network interface or multicast group; one for each robot"),
    "bus_port": Argument("43113", "UDP port, used by bus_interface:=udp_multicast only"),
    "autostart": Argument(
        "true", "the driver begins to measure by itself; false: by ros2 lifecycle"
    ),
    "activate_on_start": Argument(
        "false", "the driver also activates itself, so that the robot may move"
    ),
    "start_up_check": Argument(
        "true", "an activation first tests every valve with a small pulse of air"
    ),
    "startup_timeout": Argument("10.0", "how long autostart waits for all boards [s]"),
    "realtime_priority": Argument(
        "20", "real-time priority of the loops, where the system permits it; 0: none"
    ),
    "on_driver_exit": Argument(
        "shutdown",
        "when the driver ends: end all nodes, or restart it without autostart",
        ("shutdown", "restart"),
    ),
    "params_file": Argument(
        "", "parameters of the nodes besides the rig file, such as controller.yaml"
    ),
    "respawn": Argument(
        "false",
        "start model and controller again when they end, with one_process:=false; the driver: see "
        "on_driver_exit",
        _YES_NO,
    ),
    "urdf": Argument("", "URDF for robot_state_publisher; empty: made of the rig file"),
    "view": Argument(
        "false", "show the robot in a browser (docs/watching.md; needs rerun-sdk)", _YES_NO
    ),
}
_OF_ROBOT: Final = ("autostart", "activate_on_start", "start_up_check", "startup_timeout")
OF_SIMULATION: Final = tuple(name for name in ARGUMENTS if name not in _OF_ROBOT)
"""Those of simulation.launch.py, which decides itself when air may move."""


def declarations(
    names: Collection[str] = tuple(ARGUMENTS), **defaults: Any
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and keywords of a `DeclareLaunchArgument` for each of the arguments.

    Parameters
    ----------
    names : collection of str, optional
        Of `ARGUMENTS`.
    **defaults
        What replaces the default of an argument: text, or a substitution of launch.
    """
    for name in names:
        default, text, choices = ARGUMENTS[name]
        given = {"default_value": defaults.get(name, default), "description": text}
        yield name, given | ({"choices": list(choices)} if choices else {})
