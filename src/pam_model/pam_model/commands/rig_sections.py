"""Commands that write parts of a robot description."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

from pam_model.argument_types import make_parents, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.commands.muscle_arguments import (
    EXPECTED,
    add_geometry,
    given_geometry,
    in_both_words,
)
from pam_model.common_options import add_rig, chosen_rig
from pam_model.errors import PamError
from pam_model.muscle_sizes import SIZES
from pam_ros.program_name import PROGRAM

if TYPE_CHECKING:
    from pam_model.robot import Robot


def _declare_braid(parser: Parser) -> None:
    add_geometry(parser)
    parser.add_argument("--name", default="muscle", help="(default: %(default)s)")


def _braid(chosen: Arguments) -> Outcome:
    from pam_model.rig.from_datasheet import BraidFromDatasheet  # noqa: PLC0415  (numpy)

    geometry = given_geometry(chosen)
    if geometry is None:
        raise PamError(EXPECTED)
    made = BraidFromDatasheet.of_geometry(geometry)
    print(made.section(chosen.name))
    print(f"# {in_both_words(geometry)}")
    if chosen.size is not None:
        bought = SIZES[chosen.size]
        angle = math.degrees(math.acos(made.rest_length / made.thread_length))
        print(
            f"# {chosen.size}: the angle of the threads is not published. With {angle:.3g} deg the "
            f"ideal braid has\n# the published force of {bought.force:g} N at "
            f"{1e-5 * bought.pressure:g} bar. Permitted contraction: "
            f"{100.0 * bought.contraction:g} %. A fit to measurements is better: "
            f"{PROGRAM} model fit"
        )
    per_bar, share = 1e5 * made.force_per_pressure, made.largest_contraction
    print(
        f"# ideal braid: pulls {per_bar:.3g} N per bar at rest length, contracts by at most "
        f"{100.0 * share:.3g} %"
    )
    return Outcome({**asdict(made), "force_per_pressure": made.force_per_pressure,
                    "largest_contraction": share})  # fmt: skip


def _declare_export(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--output", type=output_file, metavar="FILE", help="(default: standard output)"
    )


def _export(chosen: Arguments, kind: str, view: Callable[[Robot, str], str]) -> Outcome:
    from pam_model.rig import load_rig  # noqa: PLC0415  (numpy)
    from pam_model.robot import compose  # noqa: PLC0415

    rig = chosen_rig(chosen)
    document = view(compose(load_rig(rig)), rig.stem)
    if chosen.output is None:
        print(document, end="")
    else:
        make_parents(chosen.output).write_text(document)
        print(f"written: {chosen.output}")
    return Outcome({kind: document, "file": chosen.output})


def _urdf(chosen: Arguments) -> Outcome:
    from pam_model.views.urdf import robot_as_urdf  # noqa: PLC0415

    return _export(chosen, "urdf", robot_as_urdf)


def _mjcf(chosen: Arguments) -> Outcome:
    from pam_model.views.mjcf import robot_as_mjcf  # noqa: PLC0415

    return _export(chosen, "mjcf", robot_as_mjcf)


COMMANDS = (
    Command(
        "braid",
        "write the muscle section of a rig file from a data sheet",
        _declare_braid,
        _braid,
        examples=("pam model braid --diameter 20e-3 --length 0.3 --angle 23",),
    ),
    Command(
        "urdf",
        "write the joints of a rig as URDF",
        _declare_export,
        _urdf,
        examples=("pam model urdf --rig config/elbow.yaml --output elbow.urdf",),
    ),
    Command(
        "mjcf",
        "write the joints and muscles of a rig as MJCF, for MuJoCo",
        _declare_export,
        _mjcf,
        examples=("pam model mjcf --rig config/elbow.yaml --output elbow.xml",),
    ),
)
