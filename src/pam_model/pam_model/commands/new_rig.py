"""Command that writes a new rig file: it asks for what the options leave out."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from pam_model.argument_types import (
    WrongArgument,
    make_parents,
    muscle_size,
    names,
    new_file,
    number,
    one_of,
)
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.errors import PamError
from pam_model.muscle_sizes import SIZES
from pam_ros.program_name import PROGRAM

OF_BRAID = ("diameter", "angle")
"""What a size that can be bought answers, or the threads do."""
FLOW, REGULATOR = "flow", "pressure_regulator"


class Question(NamedTuple):
    """One number of the rig."""

    name: str  # of the option
    text: str  # what is asked
    # what an Enter means; the name of an earlier question for the same answer as there
    default: str
    read: Callable[[str], Any]  # type of the answer


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
        "max_pressure",
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
    parser.add_argument(
        "--size", type=muscle_size, metavar="NAME",
        help=f"a muscle that can be bought, in place of diameter and angle: {', '.join(SIZES)}",
    )  # fmt: skip
    for question in QUESTIONS:
        also = ["--rest-length"] if question.name == "length" else []  # as other commands call it
        parser.add_argument(
            option_of(question), *also, type=question.read, metavar="X", dest=question.name,
            help=f"{question.text} (default: {question.default})",
        )  # fmt: skip
    parser.add_argument(
        "--thread-length", type=number("m", above=0.0), metavar="X",
        help="b of a thread, with --turns in place of diameter and angle [m]",
    )  # fmt: skip
    parser.add_argument(
        "--turns", type=number("-", above=0.0), metavar="X", help="n of this thread [-]"
    )


def ask(question: Question, default: str) -> Any:
    """Ask for an answer, which may also come from a pipe; an empty line takes the default.

    A person is asked again until the answer can be used. The question goes to standard error, so
    that --json has standard output for itself.

    Raises
    ------
    PamError
        If the input has ended, or a line of a pipe cannot be used.
    """
    end = "" if sys.stdin.isatty() else "\n"
    while True:
        print(f"{question.text} [{default}]: ", end=end, file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        option = option_of(question)
        if not line:
            raise PamError(
                f"the input ended before the answer to {option}; give one line for each question, "
                "name the option, or accept the defaults with --defaults"
            )
        try:
            return question.read(line.strip() or default)
        except WrongArgument as error:
            if not sys.stdin.isatty():  # the lines that follow answer other questions
                raise PamError(f"{option}: {error}") from None
            print(error, file=sys.stderr)


def option_of(question: Question) -> str:
    """The option that answers a question."""
    return f"--{question.name.replace('_', '-')}"


def _default(question: Question, answers: dict[str, Any], size: str | None) -> str:
    """What an empty answer means, which may follow from earlier ones."""
    if question.default in answers:
        return f"{answers[question.default]:g}"
    if question.name == "max_pressure" and size is not None:
        return f"{min(float(question.default), SIZES[size].pressure):g}"
    return question.default


def _run(chosen: Arguments) -> Outcome:
    from pam_model.muscles.force_model import MuscleGeometry  # noqa: PLC0415  (numpy)
    from pam_model.rig import load_rig  # noqa: PLC0415
    from pam_model.rig.from_datasheet import BraidFromDatasheet  # noqa: PLC0415
    from pam_model.rig.new_rig import NewRig  # noqa: PLC0415

    if chosen.size is not None and (chosen.diameter, chosen.angle) != (None, None):
        raise PamError("--size states diameter and angle: expected --size, or these two numbers")
    threads = (chosen.thread_length, chosen.turns)
    has_threads = threads != (None, None)
    if has_threads and (None in threads or (chosen.diameter, chosen.angle) != (None, None)):
        raise PamError("--thread-length and --turns state both the braid's diameter and angle")
    if has_threads and chosen.size is not None:
        raise PamError("--size states the threads: expected --size, or --thread-length and --turns")
    answers = {question.name: getattr(chosen, question.name) for question in QUESTIONS}
    for question in QUESTIONS:
        if (chosen.size is not None or has_threads) and question.name in OF_BRAID:
            continue
        if answers[question.name] is None:
            default = _default(question, answers, chosen.size)
            given = question.read(default) if chosen.defaults else ask(question, default)
            answers[question.name] = given
    diameter, length, angle = (answers.pop(name) for name in ("diameter", "length", "angle"))
    if chosen.size is not None:
        braid = BraidFromDatasheet.of_size(chosen.size, length)
    elif has_threads:
        geometry = MuscleGeometry(chosen.thread_length, chosen.turns, length)
        braid = BraidFromDatasheet.of_geometry(geometry)
    else:
        braid = BraidFromDatasheet.measured(diameter, length, math.radians(angle))
    text = NewRig(braid=braid, **answers).text()
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
            "pam model new-rig arm.yaml --joints shoulder,elbow --size DMSP-20 --defaults",
        ),
    ),
)
