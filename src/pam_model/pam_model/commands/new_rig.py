"""Command that writes a new rig file: it asks for what the options leave out."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from pam_model.argument_types import (
    WrongArgument,
    make_parents,
    names,
    new_file,
    number,
    one_of,
)
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_ros.program_name import PROGRAM

FLOW, REGULATOR = "flow", "pressure_regulator"


class Question(NamedTuple):
    """One number of the rig: name of the option, what is asked, what an Enter means, its type."""

    name: str
    text: str
    default: str
    read: Callable[[str], Any]


QUESTIONS = (
    Question("joints", "names of the joints, separated by commas", "joint", names),
    Question(
        "buses",
        "CAN interfaces, separated by commas; one carries 6 boards of a joint at 500 Hz",
        "can0",
        names,
    ),
    Question(
        "diameter",
        "braid diameter of a muscle at rest [m]",
        "0.014",
        number("m", above=0, most=0.5),
    ),
    Question(
        "length", "length between its fittings at rest [m]", "0.25", number("m", above=0, most=10)
    ),
    Question(
        "angle",
        "angle between thread and axis at rest [deg]",
        "25",
        number("deg", above=1, most=90),
    ),
    Question("pulley_radius", "radius of the pulley [m]", "0.02", number("m", above=0, most=2)),
    Question(
        "largest_angle", "the joint turns by +- [rad]", "1.0", number("rad", above=0, most=6.3)
    ),
    Question("inertia", "inertia about the joint [kg m^2]", "0.02", number("kg m^2", above=0)),
    Question("gravity_torque", "torque of gravity at 90 degrees [N m]", "1.0", number("N m")),
    Question(
        "viscous_friction", "viscous friction [N m s/rad]", "0.1", number("N m s/rad", least=0)
    ),
    Question(
        "max_pressure",
        "largest pressure of the muscles [Pa gauge]",
        "500000",
        number("Pa", above=1e4),
    ),
    Question(
        "supply_pressure",
        "pressure before the valves [Pa gauge]",
        "600000",
        number("Pa", above=1e4),
    ),
    Question("valve", f"kind of valve, {FLOW} or {REGULATOR}", FLOW, one_of(FLOW, REGULATOR)),
    Question(
        "sonic_conductance",
        "sonic conductance C of a valve [m^3/(s Pa)]",
        "4e-9",
        number("m^3/(s Pa)", above=0),
    ),
)


def _declare(parser: Parser) -> None:
    parser.add_argument("output", type=new_file, metavar="FILE", help="the rig file to write")
    parser.add_argument(
        "--defaults", action="store_true", help="ask nothing: defaults for what is left out"
    )
    for question in QUESTIONS:
        option = f"--{question.name.replace('_', '-')}"
        parser.add_argument(
            option, type=question.read, metavar="X",
            help=f"{question.text} (default: {question.default})",
        )  # fmt: skip


def ask(question: Question) -> Any:
    """Ask until the answer can be used; Enter takes the default.

    The question goes to standard error, so that --json has standard output for itself.
    """
    while True:
        print(f"{question.text} [{question.default}]: ", end="", file=sys.stderr, flush=True)
        given = sys.stdin.readline().strip() or question.default
        try:
            return question.read(given)
        except WrongArgument as error:
            print(error, file=sys.stderr)


def _run(chosen: Arguments) -> Outcome:
    from pam_model.rig import load_rig  # noqa: PLC0415  (numpy)
    from pam_model.rig.from_datasheet import BraidFromDatasheet  # noqa: PLC0415
    from pam_model.rig.new_rig import NewRig  # noqa: PLC0415

    asks = sys.stdin.isatty() and not chosen.defaults
    answers: dict[str, Any] = {}
    for question in QUESTIONS:
        given = getattr(chosen, question.name)
        if given is None:
            given = ask(question) if asks else question.read(question.default)
        answers[question.name] = given
    size = (answers.pop("diameter"), answers.pop("length"), math.radians(answers.pop("angle")))
    text = NewRig(braid=BraidFromDatasheet.measured(*size), **answers).text()
    make_parents(chosen.output).write_text(text, encoding="utf-8")
    rig = load_rig(chosen.output)
    print(f"written: {chosen.output}; check it: {PROGRAM} driver check-rig {chosen.output}")
    return Outcome({"file": chosen.output, "joints": rig.joint_names, "muscles": rig.muscle_names})


COMMANDS = (
    Command(
        "new-rig",
        "write a commented rig file; asks for what the options leave out",
        _declare,
        _run,
        examples=(
            "pam model new-rig my_robot.yaml",
            "pam model new-rig arm.yaml --joints shoulder,elbow --length 0.3 --defaults",
        ),
    ),
)
