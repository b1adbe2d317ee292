"""Compares a recorded position with the angle at which the pressures alone would hold the joint.

A zero that is half a turn off and an angle in degrees both look like a position that is too large.
The pressures tell them apart: what the encoder shows is, but for friction and inertia, the angle of
static equilibrium times a factor (a unit, or a reversed sign), plus an offset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pam_gap.recordings.recording import JOINTS, PRESSURES, TURNED_OVER, Array, Recording
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.gravity import gravity_torque

SAMPLES = 200
"""Number of instants that are compared."""
FEWEST = 20
"""Of them must have an equilibrium within the limits of the joint."""
ANGLES = 81
"""Angles at which the torque is computed; the equilibrium is interpolated."""
RELATED = 0.7
"""Correlation with the equilibrium above which factor and offset mean something."""
UNITS = {"rad": 1.0, "deg": 180.0 / math.pi, "mrad": 1e3}
"""Units of angles, per rad."""
SAME_UNIT = 3.0
"""Largest ratio of a factor to that of a unit which it is taken for; the model is not exact."""
RIGHT_ANGLE = 0.3
"""Distance from a multiple of a right angle within which an offset is taken for it [rad]."""


@dataclass(frozen=True, slots=True)
class EncoderReading:
    """How a recorded position follows from the angle of the joint."""

    unit: str  # its unit
    is_reversed: bool  # whether it counts the other way
    offset: float  # what it shows at the angle 0 [rad]

    @property
    def right_angles(self) -> int:
        """Number of right angles by which the zero is off; 0 if it is off by another angle."""
        count = round(self.offset / (0.5 * math.pi))
        return count if abs(self.offset - count * 0.5 * math.pi) < RIGHT_ANGLE else 0

    def words(self) -> str:
        """What was found and how to undo it; empty for a right reading."""
        found = []
        if self.unit != "rad":
            found.append(f"{self.unit} (multiply by {1.0 / UNITS[self.unit]:.7g})")
        if self.is_reversed:
            found.append("an encoder that counts the other way (multiply by -1)")
        exact = self.right_angles * 0.5 * math.pi
        if exact:
            undone = f"{'subtract' if exact > 0.0 else 'add'} {abs(exact):.5g} rad"
            found.append(f"a zero that is off by {90 * self.right_angles} deg ({undone})")
        elif abs(self.offset) > RIGHT_ANGLE:
            found.append(f"a zero that is off by about {self.offset:.2g} rad")
        return ", and ".join(found)


def equilibria(rig: Rig, joint: int, pressures: Array) -> Array:
    """Angles at which the pulls of both muscles and the load balance [rad]; NaN without one.

    Parameters
    ----------
    rig : Rig
        The rig with its effects.
    joint : int
        Number of the joint.
    pressures : ndarray, shape (N, 2)
        Of its muscles [Pa gauge].
    """
    robot = compose(rig)
    entry = robot.joints[joint]
    statics = JointStatics.from_robot(robot, entry)
    pairs = [(float(a), float(b)) for a, b in np.maximum(pressures, 0.0)]
    angles, rows = [], []
    for angle in np.linspace(*entry.position_limits, ANGLES).tolist():
        try:
            torques = np.array(statics.torques(pairs, angle))
        except PamError:
            continue  # outside the lengths of a muscle
        angles.append(angle)
        rows.append(torques + gravity_torque(entry, angle))
    found = np.full(len(pairs), np.nan)
    if len(rows) < 2:
        return found
    grid, torque = np.array(angles), np.array(rows)
    falls = (torque[:-1] > 0.0) & (torque[1:] <= 0.0)
    for k in np.flatnonzero(falls.sum(axis=0) == 1):
        i = int(np.argmax(falls[:, k]))
        before, after = torque[i, k], torque[i + 1, k]
        found[k] = grid[i] + (grid[i + 1] - grid[i]) * before / (before - after)
    return found


def encoder_reading(rig: Rig, joint: int, recording: Recording) -> EncoderReading | None:
    """How the recorded position follows from the angle of the joint; None if it does not show.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    joint : int
        Number of the joint.
    recording : Recording
        A recording with both pressures and the position of the joint.
    """
    entry = rig.joints[joint]
    names = [*(f"{PRESSURES}{m}" for m in entry.muscles), f"{JOINTS}{entry.name}.position"]
    if recording.mounting == TURNED_OVER or not all(recording.has(name) for name in names):
        return None
    valid = np.flatnonzero(np.all([recording.valid[name] for name in names], axis=0))
    if valid.size < SAMPLES:
        return None
    rows = valid[np.linspace(0, valid.size - 1, SAMPLES).astype(np.intp)]
    first, second, shown = (recording.values[name][rows] for name in names)
    angle = equilibria(rig, joint, np.column_stack([first, second]))
    known = np.isfinite(angle)
    if known.sum() < FEWEST or min(np.ptp(angle[known]), np.ptp(shown[known])) <= 0.0:
        return None
    angle, shown = angle[known], shown[known]
    correlation = float(np.corrcoef(angle, shown)[0, 1])
    if abs(correlation) < RELATED:
        return None
    sign = math.copysign(1.0, correlation)
    factor = float(np.std(shown) / np.std(angle))
    unit, size = min(UNITS.items(), key=lambda pair: abs(math.log(factor / pair[1])))
    if abs(math.log(factor / size)) > math.log(SAME_UNIT):
        return None
    return EncoderReading(unit, sign < 0.0, float(np.median(shown / size - sign * angle)))
