"""Time of one step of the controller, by number of joints, while the joints follow a motion.

    python benchmarks/control_bench.py [--joints 1 2 4 7] [--json] [--check]

The step is called back to back with measurements at 500 Hz, so that the processor's caches are
warm; within a node, between other processes, it takes up to four times as long. The mean is what
the controller needs of a processor; what is learnt is computed in some of the steps, which
therefore take longer than the others. The times are processor times, so that other processes are
not counted. Those still take caches away: the same steps run several times, and of each step the
least time counts.
Beside them, in the same run, the least that a step of the model-based law needs: the inverse model,
once, for each joint.
"""

from __future__ import annotations

import gc
import math
import sys
import time
from statistics import fmean, median, quantiles

from arm_of_joints import arm

from pam_control.control_step import Measurement
from pam_control.controller_parameters import create_controller, parameter_table
from pam_model.argument_types import count
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Rig

PERIOD = 0.002  # s
STEPS = 1500
RUNS = 5
FIRST, EACH = 20.0, 10.0  # us, the goal: for one step, and for each joint


def step_times(rig: Rig) -> list[float]:
    """Processor times of the steps while all joints swing [s]; the least of several runs."""
    return [min(times) for times in zip(*(one_run(rig) for _ in range(RUNS)), strict=True)]


def one_run(rig: Rig) -> list[float]:
    """Processor times of the steps of one run [s]."""
    values = {one.name: one.default for one in parameter_table(rig.joint_names)}
    controller = create_controller(rig, values, rig.joint_names)
    gc.collect()
    gc.freeze()  # as in a node, so that no cycle looks through what was imported
    times = []
    now = 1.0
    for step in range(STEPS + 100):
        now += PERIOD
        q = 0.3 * math.sin(2.0 * now)
        if step % 5 == 0 and controller.active:
            reference = [0.3 * math.sin(2.0 * (now + 0.01))] * len(rig.joints)
            controller.references.stream(rig.joint_names, reference, (), now=now)
        measured = Measurement(
            [q] * len(rig.joints), [2e5 + 1e4 * q] * len(rig.muscles), now - PERIOD, now - PERIOD
        )
        start = time.thread_time()
        output = controller.step(now, measured)
        if step >= 100:
            times.append(time.thread_time() - start)
        if output.commands is None:
            raise SystemExit(f"the controller stopped: {output.reason}")
    return times


def bare_time(rig: Rig) -> float:
    """Median processor time of the inverse model, once for each joint [s]; of the same runs."""
    return min(_bare_run(rig) for _ in range(RUNS))


def _bare_run(rig: Rig) -> float:
    joints = [JointStatics.from_rig(rig, name) for name in rig.joint_names]
    gc.collect()
    gc.freeze()  # as in a node, so that no cycle looks through what was imported
    times = []
    for step in range(STEPS):
        q = 0.3 * math.sin(0.004 * step)
        start = time.thread_time()
        for joint in joints:
            joint.pressures_for(0.5, 8.0, q)
        times.append(time.thread_time() - start)
    return median(times)


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--joints", type=count(1, 7), nargs="+", default=[1, 2, 4, 7], help="sizes of the arm"
    )


def _run(given: Arguments) -> Outcome:
    """Measure and print a table."""
    rows, missed = [], []
    print("joints   mean [us]   p50 [us]   p99 [us]   longest [us]   goal [us]   "
          "inverse model alone [us]   ratio")  # fmt: skip
    for joints in given.joints:
        rig = arm(joints)
        times = step_times(rig)
        middle, high = 1e6 * median(times), 1e6 * quantiles(times, n=100)[98]
        mean, longest = 1e6 * fmean(times), 1e6 * max(times)
        goal, bare = FIRST + EACH * joints, 1e6 * bare_time(rig)
        rows.append({"joints": joints, "mean_us": mean, "p50_us": middle, "p99_us": high,
                     "longest_us": longest, "goal_us": goal, "bare_us": bare})  # fmt: skip
        print(f"{joints:6d}   {mean:9.1f}   {middle:8.1f}   {high:8.1f}   {longest:12.1f}   "
              f"{goal:9.0f}   {bare:24.1f}   {middle / bare:5.1f}")  # fmt: skip
        if middle > goal:
            missed.append(f"{joints} joints: {middle:.0f} us, goal {goal:.0f} us")
    return Outcome(rows, missed)


BENCH = Command("control", "time of one control step", _declare, _run, "if a goal is missed")

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/control_bench.py"))
