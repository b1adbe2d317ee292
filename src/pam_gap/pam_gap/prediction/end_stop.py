"""Finds an end stop in the balance of torques, without a simulation.

At a stop, a torque that no muscle makes grows from some angle to the end of the motion. Effects of
the muscles are smooth over the whole range and imitate it only roughly, but well enough to be named
for it. The torque that the nominal rig lacks is regressed on a smooth law of angle, speed and
pressures, with and without a one-sided spring from some angle on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pam_gap.prediction.channel_order import AGONIST_PRESSURE, POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import Array
from pam_gap.prediction.local_polynomial import local_polynomial
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import TURNED_OVER
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.robot import compose
from pam_model.views.torque_balance import inertia_torque, unbalanced_torque

MOST_SAMPLES = 1500
"""Largest number of instants of a recording that are compared."""
KNEES = np.linspace(-0.2, 0.9, 12)
"""Angles at which a stop may begin, where the motion is from -1 to 1."""


@dataclass(frozen=True, slots=True)
class EndStop:
    """A one-sided spring at one end of the motion."""

    sign: float  # 1 at the upper end, -1 at the lower end
    begins: float  # angle from which it acts [rad]
    stiffness: float  # [N m/rad]
    gain: float  # share of the squared torque that a smooth law leaves and the stop explains

    @property
    def name(self) -> str:
        """In words, for the answer."""
        end = "upper" if self.sign > 0.0 else "lower"
        return f"an end stop near {self.begins:.2g} rad at the {end} end of the motion"

    def torque(self, position: Array) -> Array:
        """Torque on the joint [N m] at these angles [rad]."""
        beyond = np.maximum(self.sign * (position - self.begins), 0.0)
        result: Array = -self.sign * self.stiffness * beyond
        return result


def _balance(problem: PredictionProblem, data: Channels) -> tuple[Array, Array]:
    """Angle, speed and both pressures, shape (n, 4), and the torque that is lacking, shape (n,)."""
    robot = compose(problem.rig)
    joint = robot.joints[problem.joint]
    statics = JointStatics.from_robot(robot, joint)
    step = data.recording.sample_time
    width = max(5, round(problem.rules.search.end_stop_window / step) // 2 * 2 + 1)
    angle = data.measured[:, POSITION : POSITION + 1]
    smooth, speed, bend = (
        local_polynomial(angle, width, 2, derivative=order, step=step)[:, 0] for order in range(3)
    )
    rows = np.linspace(width, len(angle) - width - 1, min(MOST_SAMPLES, len(angle))).astype(np.intp)
    rows = rows[data.known[rows].all(axis=1, where=problem.recorded)]
    pressures = np.maximum(data.measured[rows, AGONIST_PRESSURE : AGONIST_PRESSURE + 2], 0.0)
    found, lacking = [], []
    for k, pair in zip(rows.tolist(), pressures.tolist(), strict=True):
        try:
            torque = statics.torque(pair, float(smooth[k]))
        except PamError:
            continue  # outside the lengths of a muscle
        found.append((smooth[k], speed[k], *pair))
        rest = unbalanced_torque(joint, torque, float(smooth[k]), float(speed[k]))
        lacking.append(rest - inertia_torque(joint, float(bend[k])))
    return np.array(found).reshape(-1, 4), np.array(lacking)


def end_stop(problem: PredictionProblem) -> EndStop | None:
    """The end stop that the recordings show; None without one."""
    usable = [
        data
        for data in problem.data
        if data.recording.mounting != TURNED_OVER and data.votes[POSITION] and data.external is None
    ]
    if not problem.present[POSITION] or len(usable) < len(problem.data):
        return None
    parts = [_balance(problem, data) for data in usable]
    seen = np.concatenate([part[0] for part in parts])
    lacking = np.concatenate([part[1] for part in parts])
    if len(seen) < problem.rules.recording.stretch:
        return None
    angle, speed, first, second = seen.T
    low, high = float(angle.min()), float(angle.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-9)
    place = (angle - middle) / half
    rubbing = np.clip(speed / problem.rules.search.end_stop_slow, -1.0, 1.0)
    scale = max(float(first.max()), float(second.max()), 1.0)
    smooth = np.column_stack(
        [place**n for n in range(4)] + [rubbing, speed, first / scale, second / scale]
    )

    def left(columns: Array) -> tuple[float, float]:
        found = np.linalg.lstsq(columns, lacking, rcond=None)[0]
        return float(np.sum((lacking - columns @ found) ** 2)), float(found[-1])

    before = left(smooth)[0]
    best: EndStop | None = None
    for sign in (1.0, -1.0):
        for knee in KNEES.tolist():
            beyond = np.maximum(sign * place - knee, 0.0)
            after, slope = left(np.column_stack([smooth, beyond]))
            gain = 1.0 - after / max(before, 1e-12)
            if sign * slope > 0.0 and (best is None or gain > best.gain):
                begins = middle + sign * knee * half
                best = EndStop(sign, begins, abs(slope) / half, gain)
    if best is None or best.gain < problem.rules.search.end_stop_gain:
        return None
    return best
