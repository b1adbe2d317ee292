"""Arguments that describe a muscle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_model.argument_types import named_number, number
from pam_model.command_line import Arguments, Parser
from pam_model.errors import PamError

if TYPE_CHECKING:
    from pam_model.muscles.force_model import MuscleGeometry


def given_geometry(chosen: Arguments) -> MuscleGeometry | None:
    """The geometry that was given; None if none was.

    Raises
    ------
    PamError
        If only a part of it was given.
    """
    given = [chosen.thread_length, chosen.turns, chosen.rest_length]
    if all(value is None for value in given):
        return None
    if any(value is None for value in given):
        raise PamError("--thread-length [m], --turns and --rest-length [m] must be given together")
    from pam_model.muscles.force_model import MuscleGeometry  # noqa: PLC0415  (numpy)

    return MuscleGeometry(
        chosen.thread_length, chosen.turns, chosen.rest_length, chosen.wall_thickness
    )


def add_muscle(parser: Parser) -> None:
    """Declare the options for a muscle's geometry and the constants of its model."""
    parser.add_argument("--thread-length", type=number("m", above=0.0), metavar="M", help="b [m]")
    parser.add_argument("--turns", type=number("", above=0.0), metavar="N", help="n [-]")
    parser.add_argument("--rest-length", type=number("m", above=0.0), metavar="M", help="[m]")
    parser.add_argument(
        "--wall-thickness", type=number("m", least=0.0), default=0.0, metavar="M",
        help="[m] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--set", type=named_number, nargs="+", default=[], metavar="NAME=NUMBER",
        help="a constant of the model",
    )  # fmt: skip
