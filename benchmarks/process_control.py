"""Control in one process and in three, on the plant of the blind check.

    python benchmarks/process_control.py [--one 1.2 2.5] [--three 2.7 8.7] [--effects payload]

The same controller plays the same motions on the same true rigs; what differs is the time from a
measurement to the command that answers it, which is drawn in each cycle from a log-normal
distribution with the median and the 99th percentile that `latency_bench.py` has measured. For each
way the gains are designed for the delay that its controller is given (`loop.command_delay`).
"""

from __future__ import annotations

import math
import random
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.truth_plant import Sensors, TruthJoint
from pam_check.control.closed_loop import APPROACH, RESTS, SETTLED, START_PRESSURE, Muscles
from pam_check.control.hidden_rigs import NOTHING
from pam_check.control.rough_control import RoughControl
from pam_check.control.running_truth import RunningTruth
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.controller_parameters import COMMAND_DELAY
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.argument_types import number
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig
from pam_robot.direct_link import COMMAND_DELAY as DIRECT_DELAY

PERIOD = 0.002  # s, of the controller
STEP = 0.0005  # s, of the plant
STEPS = round(PERIOD / STEP)
AGE = 0.001  # s, of a measurement when the cycle begins: boards have clocks of their own
LEAST = AGE + 0.0002  # s; no command answers sooner
EFFECTS = (NOTHING, "coulomb_friction", "payload", "hysteresis", "command_delay", "pressure_lag")


@dataclass(frozen=True, slots=True)
class Latency:
    """Times from a measurement frame to the command frame.

    Attributes
    ----------
    median, high : float
        The median and the 99th percentile [s].
    """

    median: float
    high: float

    def draw(self, source: random.Random) -> float:
        """One time [s]."""
        spread = math.log(self.high / self.median) / NormalDist().inv_cdf(0.99)
        return max(LEAST, self.median * math.exp(spread * source.gauss(0.0, 1.0)))


def play(
    controller: Controller,
    joint: TruthJoint,
    muscles: Muscles,
    points: Sequence[TrajectoryPoint],
    latency: Latency,
    seed: int,
) -> float:
    """RMS error of the true angle during a motion [rad]; infinite if the controller stopped."""
    source = random.Random(seed)
    motion = points[-1].time_from_start
    count = round((SETTLED + motion + RESTS) / PERIOD)
    plant = RunningTruth(
        joint, muscles, Sensors(), np.random.default_rng(seed),
        period=STEP, count=count * STEPS, pressure=START_PRESSURE,
    )  # fmt: skip
    controller.drop_commands()
    name = controller.rig.joints[0].name
    commands, coming = (0.0, 0.0), deque[tuple[float, tuple[float, float]]]()
    begin, errors = round(SETTLED / PERIOD), []
    for k in range(count):
        now = k * PERIOD
        taken = now - AGE
        if k == round(APPROACH[0] / PERIOD):
            start = [TrajectoryPoint(APPROACH[1], [0.0], [0.0], [0.0])]
            controller.references.follow([name], start, start=None, now=now)
        if k == begin:
            controller.references.follow([name], points, start=None, now=now)
        measured = Measurement((), (), taken, taken)
        for step in range(STEPS):
            at = taken + step * STEP
            if step == round(AGE / STEP):
                output = controller.step(now, measured)
                if output.commands is None:
                    return math.inf
                acts = taken + latency.draw(source)
                if coming:
                    acts = max(acts, coming[-1][0])  # a bus keeps the order
                coming.append((acts, (output.commands[0], output.commands[1])))
            while coming and coming[0][0] <= at + 0.5 * STEP:
                commands = coming.popleft()[1]
            shown = plant.advance(commands)
            if step == 0:
                pressures = [float(shown[0]), float(shown[1])]
                measured = Measurement([float(shown[2])], pressures, taken, taken)
        if begin <= k < begin + round(motion / PERIOD):
            reference = controller.references.sample(name, taken).position
            errors.append(reference - plant.truth[k * STEPS, 2] - joint.position_offset)
    return float(np.sqrt(np.mean(np.square(errors))))


def _declare(parser: Parser) -> None:
    for way, median, high in (("one", 1.2, 2.5), ("three", 2.7, 8.7)):
        parser.add_argument(
            f"--{way}", nargs=2, type=number("ms", above=0.0), default=[median, high],
            metavar=("P50", "P99"), help=f"delay with {way} process(es) [ms] (%(default)s)",
        )  # fmt: skip
    parser.add_argument(
        "--effects", nargs="+", choices=[NOTHING, *KNOWN], default=EFFECTS, help="hidden in the rig"
    )
    parser.set_defaults(rig=None)


def _run(given: Arguments) -> Outcome:
    """Play and print."""
    rig = load_rig(chosen_rig(given))
    ways = {
        "one process": (Latency(*(1e-3 * one for one in given.one)), DIRECT_DELAY),
        "three processes": (Latency(*(1e-3 * one for one in given.three)), COMMAND_DELAY),
    }
    roughs = {}
    for way, (latency, delay) in ways.items():
        settings = ControlSettings(period=PERIOD, measurement_delay=0.0, command_delay=delay)
        roughs[way] = RoughControl(rig, settings, 1)
        print(
            f"{way}: {1e3 * latency.median:.2f} ms, p99 {1e3 * latency.high:.2f} ms; designed for "
            f"{1e3 * delay:g} ms"
        )
    print(f"RMS error [mrad]     motion  {'':2s}" + "".join(f"{way:>17s}" for way in ways))
    rows = []
    for effect in given.effects:
        for place, motion in enumerate(roughs["one process"].motions):
            found = {}
            for way, (latency, _) in ways.items():
                rough = roughs[way]
                joint, muscles = rough.hidden(effect)
                rough.controller.forget_adaptation()
                rough.controller.deactivate()
                points = rough.motions[motion]
                found[way] = 1e3 * play(
                    rough.controller, joint, muscles, points, latency, 1 + place
                )
            rows.append({"effect": effect, "motion": motion, **found})
            cells = "".join(f"{value:17.2f}" for value in found.values())
            print(f"{effect:20s} {motion:8s} {cells}", flush=True)
    return Outcome(rows)


BENCH = Command("process_control", "control in one process and in three", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/process_control.py"))
