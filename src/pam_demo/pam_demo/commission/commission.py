"""`pam demo commission --rig ROUGH.yaml --out DIR`: from a data sheet to a joint that tracks.

It writes commissioned.yaml, commission.json and commission.html, and keeps the recordings, so that
it goes on where it was interrupted.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pam_demo.commission.commissioned import Commissioned, SequenceStep
from pam_demo.commission.exchange import Confirm, CrossedPort, Mend, nobody
from pam_demo.commission.expected_tracking import NoisyPort, SensorNoise
from pam_demo.commission.kept import Kept
from pam_demo.commission.lower_priority import Compute, at_lower_priority, at_same_priority
from pam_demo.commission.page import write_page
from pam_demo.commission.robot_port import RobotPort
from pam_demo.commission.sequence import Ask, Commissioning
from pam_demo.commission.simulated_port import SimulatedPort
from pam_demo.commission.tracking import Tracked
from pam_gap.calibration.answer import comments, to_json
from pam_gap.calibration.free_numbers import Said
from pam_gap.calibration.known_rig import as_known
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig, save_rig
from pam_model.rig.partial import PartialRig, load_partial_rig
from pam_ros.program_name import PROGRAM
from pam_sim.boards.sensors import SensorQuality

OpenPort = Callable[[Rig, str, float, str], AbstractContextManager[RobotPort]]
RIG, ANSWER, PAGE = "commissioned.yaml", "commission.json", "commission.html"
EARLIER: Final = "commissioned_earlier.yaml"
"""What `RIG` is called after a later commissioning in the same folder."""
YES: Final = ("y", "yes")
SENSORS: Final = SensorQuality()
"""Of a simulated robot."""
USES: Final = ("pressure", "speed", "distance_from_middle")
"""Limits, shares of which a step has used."""


def one_joint(partial: PartialRig, name: str) -> PartialRig:
    """The rig file with one joint and its muscles only.

    Raises
    ------
    PamError
        For a joint that the rig does not have, or a rig without joints.
    """
    rig = partial.rig
    if not rig.joints:
        raise PamError("the rig file has no joint; expected one to commission")
    joint = rig.joint(name or 0)
    muscles = tuple(rig.muscle(muscle) for muscle in joint.muscles)
    return replace(partial, rig=replace(rig, joints=(joint,), muscles=muscles))


def _answered(text: str) -> bool:
    try:
        return input(f"{text} [y/N] ").strip().lower() in YES
    except EOFError:
        return False


def asked_on_terminal(what: str) -> bool:
    """Ask a person whether the next step may be done; no answer is a no."""
    print(f"Next: {what}. Keep away from the arm.", flush=True)
    return _answered("Go on?")


def confirmed_on_terminal(_: Mend, text: str) -> bool:
    """Ask a person whether something is so; no answer is a no."""
    return _answered(text)


def _tracked(one: Tracked | None) -> dict[str, Any] | None:
    if one is None:
        return None
    numbers = {"rms": one.rms, "largest": one.largest}
    return {
        **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
        "unit": "rad",
        "stopped": one.stopped,
    }


def _step(step: SequenceStep) -> dict[str, Any]:
    """A step; uses of the limits by their names."""
    uses = {
        name: dict(zip(USES, getattr(step, name), strict=True)) for name in ("foreseen", "most")
    }
    return asdict(step) | uses


def _finite(values: Sequence[float]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values]


def to_document(joint: str, done: Commissioned) -> dict[str, Any]:
    """The content of commission.json."""
    return {
        "joint": joint,
        "ended": done.ended,
        "exchanged": done.exchanged,
        "seconds": done.seconds,
        "steps": [_step(step) for step in done.steps],
        "gains": done.gains,
        "tracking": {"before": _tracked(done.before), "after": _tracked(done.after)},
        "expected": None
        if done.expected is None
        else {
            "rms": _finite(done.expected.errors),
            "known": _finite([done.expected.known])[0],
            "unit": "rad",
        },
        "doubt": done.doubt,
        "calibration": None if done.calibration is None else to_json(done.calibration),
    }


def write_results(
    partial: PartialRig, name: str, done: Commissioned, out: Path, said: Said
) -> None:
    """Write the rig file, the answer and the page.

    Parameters
    ----------
    partial : PartialRig
        The whole rig file as it was.
    name : str
        Of the joint.
    done : Commissioned
        What was found.
    out : Path
        Folder. A rig file of an earlier commissioning in it gets the name `EARLIER`.
    said : Said
        How far plain numbers of the rig file could be off.
    """
    out.mkdir(parents=True, exist_ok=True)
    if (out / RIG).exists():
        (out / RIG).replace(out / EARLIER)
    if done.rig is not None and done.calibration is not None:
        rig = replace(partial.rig, supply_pressure=done.rig.supply_pressure)
        for muscle in done.rig.muscles:
            rig = rig.with_muscle(muscle)
        made = f"Made by {PROGRAM} demo commission. A comment says what is known of a number."
        rig = as_known(rig.with_joint(done.rig.joint(name)), done.calibration.numbers, said)
        save_rig(rig, out / RIG, (made,), comments(done.calibration))
    text = json.dumps(to_document(name, done), indent=1)
    (out / ANSWER).write_text(text + "\n", encoding="utf-8")
    write_page(name, done, out / PAGE)


def commission(
    port: RobotPort,
    partial: PartialRig,
    name: str,
    task: str,
    out: Path,
    said: Said,
    ask: Ask,
    compute: Compute = at_same_priority,
    confirm: Confirm = nobody,
) -> Commissioned:
    """Commission one joint on a port, and write the results.

    Parameters
    ----------
    port : RobotPort
        The robot, with empty muscles.
    partial : PartialRig
        The whole rig file.
    task : str
        Robot, rig file and settings, by which an interrupted commissioning is known again.
    out : Path
        Folder of recordings and results.
    said : Said
        How far plain numbers may be off.
    ask : callable
        Whether the next step may be done.
    compute : callable
        Calls what takes seconds between two motions.
    confirm : callable
        Whether a person says that something is exchanged, or mended.
    """

    def tell(line: str) -> None:
        print(line, flush=True)

    kept = Kept(out, task)
    alone = one_joint(partial, name)
    done = Commissioning(port, alone, said, kept, tell, ask, compute, confirm).run()
    compute(lambda: write_results(partial, name, done, out, said))
    return done


def run(
    given: Arguments,
    open_port: OpenPort,
    ask: Ask = asked_on_terminal,
    confirm: Confirm = confirmed_on_terminal,
) -> Outcome:
    """Commission a joint; the command of `pam_demo.__main__`.

    Parameters
    ----------
    given : Arguments
        Of the command line.
    open_port : callable
        Opens the port to a robot on ROS topics.
    ask, confirm : callable
        Ask a person; with `--yes` every step is allowed, and nothing is confirmed.

    Raises
    ------
    PamError
        For a rig file or a robot that cannot be used.
    """
    path = Path(given.rig)
    partial = load_partial_rig(path)
    name = one_joint(partial, given.joint).rig.joints[0].name
    said = Said(given.tolerance, given.length_tolerance)
    if given.crossed_hoses and given.simulate is None:
        raise PamError("--crossed-hoses is for a simulated robot; expected --simulate FILE with it")
    if not given.yes and not sys.stdin.isatty():
        raise PamError("commission asks before every step: start it on a terminal, or give --yes")
    asked: Ask = (lambda _: True) if given.yes else ask
    person = nobody if given.yes else confirm
    period = 1.0 / given.rate
    robot = f"robot {given.namespace}"
    if given.simulate is not None:
        robot = f"simulated {given.simulate.read_text(encoding='utf-8')} {given.crossed_hoses}"
    task = "\n".join([name, repr(said), repr(period), robot, path.read_text(encoding="utf-8")])
    if given.simulate is not None:
        true = one_joint(PartialRig(load_rig(given.simulate)), name).rig
        noise = SensorNoise(SENSORS.position_noise, 2 * (SENSORS.pressure_noise,))
        robot_port: RobotPort = NoisyPort(
            SimulatedPort(true, period), noise, np.random.default_rng(0)
        )
        if given.crossed_hoses:
            robot_port = CrossedPort.of(robot_port)
        done = commission(robot_port, partial, name, task, given.out, said, asked, confirm=person)
    else:
        with open_port(partial.rig, name, period, given.namespace) as port:
            done = commission(
                port, partial, name, task, given.out, said, asked, at_lower_priority, person
            )
    print(f"written: {given.out / PAGE}")
    if not done.ended:
        print(f"next: start all nodes with {given.out / RIG}")
    bad = [done.ended] if done.ended else []
    return Outcome({"out": given.out, **to_document(name, done)}, bad)
