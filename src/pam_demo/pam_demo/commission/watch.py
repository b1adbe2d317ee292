"""Judges every reading of a motion: what leaves the limits, or cannot be read, ends it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from pam_demo.commission.robot_port import JointReading
from pam_driver.safety.pauses import longest_gap
from pam_model.rig import Rig

FILTER: Final = 0.02  # s, of the measured speed
PRESSURE_SHARE: Final = 0.95  # of the highest permitted pressure
SPEED_SHARE: Final = 0.8  # of the largest permitted speed
END_SHARE: Final = 0.95  # of a position limit, from the middle of the range
STOOD_STILL: Final = "the computer stood still"
OUTWARD: Final = 0.1  # rad/s; slower beyond the end is a joint that hangs there


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one joint and its muscles."""

    pressures: tuple[float, float]  # highest, gauge, agonist first [Pa]
    speed: float  # largest [rad/s]
    # lower, upper: ends of the range [rad]
    lower: float
    upper: float

    @classmethod
    def of(cls, rig: Rig, joint: int = 0) -> Limits:
        """The limits that a rig file states."""
        entry = rig.joints[joint]
        first, second = (rig.muscle(name).max_pressure for name in entry.muscles)
        return cls((first, second), entry.max_velocity, *entry.position_limits)

    def shares(self, pressures: tuple[float, float], speed: float, position: float) -> list[float]:
        """How much of each limit is used: pressure, speed, distance from the middle [-]."""
        middle, half = 0.5 * (self.lower + self.upper), 0.5 * (self.upper - self.lower)
        return [
            max(p / most for p, most in zip(pressures, self.pressures, strict=True)),
            abs(speed) / self.speed,
            abs(position - middle) / half,
        ]


class Seen(NamedTuple):
    """What the watch remembers: time [s], position [rad] and filtered speed [rad/s]."""

    time: float = math.nan
    position: float = math.nan
    speed: float = 0.0


def watched(
    seen: Seen, reading: JointReading, limits: Limits, period: float = 0.004
) -> tuple[Seen, str]:
    """What is remembered after a reading, and why the motion must end; empty if it need not.

    Parameters
    ----------
    seen : Seen
        What was remembered before.
    reading : JointReading
        What the sensors showed.
    limits : Limits
        Of the joint.
    period : float, optional
        Time between two readings [s]. After a pause of this computer, in which the joint had no
        commands, a motion ends: its loop would answer to what the joint did meanwhile.
    """
    if reading.problem:
        return seen, reading.problem
    speed = seen.speed
    step = reading.time - seen.time
    if step > longest_gap(period):
        return seen, f"{STOOD_STILL} for {step:.2f} s"
    if step > 0.0:
        weight = step / (FILTER + step)
        speed += weight * ((reading.position - seen.position) / step - speed)
    now = Seen(reading.time, reading.position, speed)
    pressure, pace, place = limits.shares(reading.pressures, speed, reading.position)
    if pressure > PRESSURE_SHARE:
        return now, f"a muscle has {max(reading.pressures):.0f} Pa, {pressure:.0%} of its limit"
    if pace > SPEED_SHARE:
        most = SPEED_SHARE * limits.speed
        return now, f"the joint moves with {speed:+.1f} rad/s, and {most:.2g} end this motion"
    middle = 0.5 * (limits.lower + limits.upper)
    if place > END_SHARE and (reading.position - middle) * speed > 0.0 and abs(speed) > OUTWARD:
        return now, f"the joint is at {reading.position:+.2f} rad, near the end of its range"
    return now, ""
