"""Options that several commands have, in the same words everywhere."""

from __future__ import annotations

import os
from pathlib import Path

from pam_model.argument_types import count, input_file, number, output_folder
from pam_model.command_line import Arguments, Parser
from pam_model.errors import PamError


def add_rig(parser: Parser, *, required: bool = False) -> None:
    """Declare `--rig`; if it is not `required`, `chosen_rig` finds the example by default."""
    text = "rig file" if required else "rig file (default: the elbow of config/)"
    parser.add_argument("--rig", type=input_file, required=required, metavar="FILE", help=text)


def chosen_rig(given: Arguments) -> Path:
    """The named rig file, or the example in the source tree or in the colcon installation.

    Raises
    ------
    PamError
        If none was named and the example does not exist.
    """
    if given.rig is not None:
        return Path(given.rig)
    name = Path("config") / "elbow.yaml"
    for folder in (Path.cwd(), *Path(__file__).resolve().parents):
        if (folder / name).is_file():
            return folder / name
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        path = Path(prefix) / "share" / "pam_bringup" / name
        if prefix and path.is_file():
            return path
    raise PamError(f"{name}: not found; name a rig file with --rig")


def add_out(parser: Parser, default: str = "") -> None:
    """Declare `--out`, the folder for the results; required without a `default`."""
    parser.add_argument(
        "--out",
        type=output_folder,
        required=not default,
        default=default or None,
        help="folder for the results" + (" (default: %(default)s)" if default else ""),
    )


def add_bus(parser: Parser) -> None:
    """Declare `--interface`, `--channel` and `--port` of a CAN bus."""
    add = parser.add_argument
    add("--interface", help="python-can's interface (default: socketcan)")
    add("--channel", help="python-can's channel (default: can0)")
    add("--port", type=count(1, 65535), help="UDP port, used by udp_multicast only")


def add_dbc(parser: Parser) -> None:
    """Declare `--dbc`, the CAN database of this project's boards."""
    parser.add_argument(
        "--dbc",
        type=input_file,
        metavar="FILE",
        help="CAN database of boards of kind pam_board (default: the driver's own)",
    )


def add_namespace(parser: Parser) -> None:
    """Declare `--namespace` of a robot's nodes and topics."""
    parser.add_argument("--namespace", default="", help="of the robot's nodes (default: none)")


def add_tolerances(parser: Parser) -> None:
    """Declare how far the plain numbers of a rough rig file may be off."""
    for option, usual, text in (
        ("--tolerance", 1.0 / 3.0, "how far a plain number of the rig file may be off, relative"),
        ("--length-tolerance", 0.05, "the same for lengths, turns and the supply pressure"),
    ):
        parser.add_argument(
            option,
            type=number("", least=0.0, most=0.5),
            default=usual,
            metavar="SHARE",
            help=f"{text} (default: {usual:.2g})",
        )


def add_column_map(parser: Parser) -> None:
    """Declare `--map`, which says what the columns of tables are."""
    parser.add_argument(
        "--map",
        type=input_file,
        metavar="FILE",
        help="names, units, scales and signs of the columns of tables (docs/any_log.md)",
    )


def add_no_progress(parser: Parser) -> None:
    """Declare `--no-progress`."""
    parser.add_argument(
        "--no-progress", action="store_true", help="show no progress bar, not even on a terminal"
    )
