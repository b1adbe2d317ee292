"""Arguments that describe a muscle, in the same words for every command.

A braid may be stated by the diameter and the angle of its threads, which can be measured, by the
length and the turns of a thread, which the rig file holds, or by a size that can be bought.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pam_model.argument_types import muscle_size, named_number, number
from pam_model.command_line import Arguments, Parser
from pam_model.errors import PamError
from pam_model.muscle_sizes import SIZES

if TYPE_CHECKING:
    from pam_model.muscles.force_model import MuscleGeometry

EXPECTED = (
    "expected --rest-length, and with it --diameter and --angle, or --thread-length and --turns, "
    "or --size"
)


def given_geometry(chosen: Arguments) -> MuscleGeometry | None:
    """The geometry that was given; None if none was.

    Raises
    ------
    PamError
        If only a part of it was given, or a part twice.
    """
    stated = stated_geometry(chosen)
    if not stated:
        return None
    missing = {"rest_length", "diameter", "braid_angle"} - set(stated)
    if missing:
        options = [
            option
            for key, option in (
                ("rest_length", "--rest-length"),
                ("diameter", "--diameter"),
                ("braid_angle", "--angle"),
            )
            if key in missing
        ]
        raise PamError(f"{' and '.join(options)} missing: {EXPECTED}")
    if chosen.thread_length is not None:  # as written, without the way through an angle
        from pam_model.muscles.force_model import MuscleGeometry  # noqa: PLC0415  (numpy)

        return MuscleGeometry(
            chosen.thread_length, chosen.turns, chosen.rest_length, chosen.wall_thickness or 0.0
        )
    from pam_model.identify.free_numbers import geometry_of  # noqa: PLC0415  (numpy)

    return geometry_of({"wall_thickness": 0.0, **stated})


def geometry_to_fit(chosen: Arguments) -> tuple[MuscleGeometry | None, dict[str, float]]:
    """The whole geometry if it was given, and the numbers of it that were stated.

    Raises
    ------
    PamError
        If a number was stated in two ways, or a thread without all that it needs.
    """
    stated = stated_geometry(chosen)
    is_whole = {"rest_length", "diameter", "braid_angle"} <= set(stated)
    return (given_geometry(chosen) if is_whole else None), ({} if is_whole else stated)


def stated_geometry(chosen: Arguments) -> dict[str, float]:
    """Those numbers of a geometry that were stated, by the names with which a fit speaks of them.

    Raises
    ------
    PamError
        If a number was stated in two ways, or a thread without all that it needs.
    """
    ways = {
        "--size": chosen.size is not None,
        "--diameter and --angle": (chosen.diameter, chosen.angle) != (None, None),
        "--thread-length and --turns": (chosen.thread_length, chosen.turns) != (None, None),
    }
    used = [way for way, is_used in ways.items() if is_used]
    if len(used) > 1:
        raise PamError(f"{', '.join(used)} state the same numbers: {EXPECTED}")
    found: dict[str, float] = {}
    if chosen.rest_length is not None:
        found["rest_length"] = chosen.rest_length
    if chosen.wall_thickness is not None:
        found["wall_thickness"] = chosen.wall_thickness
    if chosen.diameter is not None:
        found["diameter"] = chosen.diameter
    if chosen.angle is not None:
        found["braid_angle"] = math.radians(chosen.angle)
    if ways["--size"] or ways["--thread-length and --turns"]:
        if chosen.rest_length is None:
            raise PamError(f"--rest-length missing: {EXPECTED}")
        found |= _of_thread(chosen) if chosen.size is None else _of_size(chosen)
    return found


def _of_thread(chosen: Arguments) -> dict[str, float]:
    if chosen.thread_length is None or chosen.turns is None:
        raise PamError("--thread-length [m], --turns and --rest-length [m] must be given together")
    from pam_model.identify.free_numbers import geometry_numbers  # noqa: PLC0415  (numpy)
    from pam_model.muscles.force_model import MuscleGeometry  # noqa: PLC0415

    given = MuscleGeometry(chosen.thread_length, chosen.turns, chosen.rest_length, 0.0)
    numbers = geometry_numbers(given)
    return {key: numbers[key] for key in ("braid_angle", "diameter")}


def _of_size(chosen: Arguments) -> dict[str, float]:
    from pam_model.rig.from_datasheet import BraidFromDatasheet  # noqa: PLC0415  (numpy)

    braid = BraidFromDatasheet.of_size(chosen.size, chosen.rest_length)
    angle = math.acos(braid.rest_length / braid.thread_length)
    return {"braid_angle": angle, "diameter": SIZES[chosen.size].diameter}


def in_both_words(geometry: MuscleGeometry) -> str:
    """A braid by what can be measured, and by what the rig file holds, as one line."""
    b, rest = geometry.thread_length, geometry.rest_length
    text = f"thread_length {b:.6g} m, turns {geometry.turns:.6g}, rest_length {rest:.6g} m"
    if not (0.0 < rest < b and geometry.turns > 0.0):
        return text
    diameter = math.sqrt(b * b - rest * rest) / (math.pi * geometry.turns)
    angle = math.degrees(math.acos(rest / b))
    return f"{text} = diameter {1e3 * diameter:.4g} mm, angle {angle:.4g} deg at rest"


def add_geometry(parser: Parser) -> None:
    """Declare the options for the geometry of a muscle."""
    parser.add_argument(
        "--rest-length", "--length", type=number("m", above=0.0, most=10.0), metavar="X",
        help="between the fittings at rest [m]",
    )  # fmt: skip
    parser.add_argument(
        "--diameter", type=number("m", above=0.0, most=0.5), metavar="X",
        help="of the braid at rest [m]",
    )  # fmt: skip
    parser.add_argument(
        "--angle", type=number("deg", above=1.0, most=90.0), metavar="X",
        help="between thread and axis at rest [deg]",
    )  # fmt: skip
    parser.add_argument(
        "--thread-length", type=number("m", above=0.0), metavar="X",
        help="b of a thread, in place of diameter and angle [m]",
    )  # fmt: skip
    parser.add_argument(
        "--turns", type=number("", above=0.0), metavar="X", help="n of this thread [-]"
    )
    parser.add_argument(
        "--size", type=muscle_size, metavar="NAME",
        help=f"a muscle that can be bought, in place of both: {', '.join(SIZES)}",
    )  # fmt: skip
    parser.add_argument(
        "--wall-thickness", type=number("m", least=0.0, most=0.1), metavar="X",
        help="of the bladder [m] (default: 0)",
    )  # fmt: skip


def add_muscle(parser: Parser) -> None:
    """Declare the options for a muscle's geometry and the constants of its model."""
    add_geometry(parser)
    parser.add_argument(
        "--set", type=named_number, nargs="+", default=[], metavar="NAME=NUMBER",
        help="a constant of the model",
    )  # fmt: skip
