"""Momentum observer: the torque on a joint that its model does not explain.

The measured pressures give the torque of the muscles. What of it does not appear as motion, gravity
or friction of the model is lost to something else: a payload, a contact, friction, hysteresis, a
muscle that is weaker than written. With the momentum p = J qd and the bandwidth L

    lost = L/(s + L) (torque of the muscles - B qd - gravity - ...) - L s/(s + L) p

so that no acceleration is needed. The speed and all torques pass a filter, and the result passes
the same filter again, because the steps of an encoder would make the valves chatter. The control
law adds `lost` to the torque that it asks for.

Pressures and position are compared at the same time: the pressures are held back by the delay of
the position that the rig file tells, and the motion is filtered like the pressures if their sensors
are known to lag. Since the torque is computed from measured pressures and not from commands, a
delay of the commands does not reach the observer.

Source: A. De Luca and R. Mattone, "Actuator failure detection and isolation using generalized
momenta", ICRA 2003 (residual of the generalised momentum).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from pam_control.limited import limited

Pair = tuple[float, float]


@dataclass(slots=True)
class ObserverSettings:
    """Settings of an observer.

    Attributes
    ----------
    bandwidth : float
        L [rad/s].
    speed_filter : float
        Time constant of the filter that the measured speed has passed [s].
    limit : float
        Largest absolute value of the result [N m].
    """

    bandwidth: float
    speed_filter: float
    limit: float


class AlignedPressures:
    """The latest measured pressures, looked up at an earlier time.

    Parameters
    ----------
    kept : float
        How far back the times may lie [s].
    """

    def __init__(self, kept: float) -> None:
        self._kept = kept
        self._samples: deque[tuple[float, Pair]] = deque()

    def reset(self) -> None:
        """Forget all samples."""
        self._samples.clear()

    def add(self, time: float, pressures: Pair) -> None:
        """Add measured pressures [Pa]; a time [s] that is not later than the last is ignored."""
        samples = self._samples
        if samples and time <= samples[-1][0]:
            return
        samples.append((time, pressures))
        while len(samples) > 2 and samples[1][0] < time - self._kept:
            samples.popleft()

    def at(self, time: float) -> Pair:
        """Pressures at a time [s]: linear between two samples, constant outside them."""
        later_time, later = self._samples[-1]
        for earlier_time, earlier in reversed(self._samples):
            if earlier_time <= time:
                span = later_time - earlier_time
                part = min((time - earlier_time) / span, 1.0) if span > 0.0 else 1.0
                (a, b), (next_a, next_b) = earlier, later
                return a + part * (next_a - a), b + part * (next_b - b)
            later_time, later = earlier_time, earlier
        return later


class DisturbanceObserver:
    """The observer of one joint.

    Parameters
    ----------
    inertia, damping : float
        J [kg m^2], B [N m s/rad].
    pressure_lag : float
        Known lag of the pressure sensors, by which the motion is filtered as well [s].

    Attributes
    ----------
    lost : float
        Torque of the muscles that the model does not explain [N m], within the limit.
    """

    def __init__(self, inertia: float, damping: float, pressure_lag: float) -> None:
        self._inertia, self._damping, self._lag = inertia, damping, pressure_lag
        self.lost = 0.0
        self.reset()

    def reset(self) -> None:
        """Forget everything; nothing is lost."""
        self.start(0.0, 0.0)

    def start(self, lost: float, limit: float) -> float:
        """Begin with a joint at rest that loses this torque [N m]; return the part in the limit."""
        self._muscles = self._motion = self._speed = math.nan
        self._state = 0.0
        self.lost = self._smooth = max(-limit, min(limit, lost))
        return self.lost

    def update(
        self, step: float, muscles: float, motion: float, speed: float, settings: ObserverSettings
    ) -> float:
        """Take a new sample and return the lost torque [N m].

        Parameters
        ----------
        step : float
            Time since the last sample [s]; 0 if there is no new one.
        muscles : float
            Torque of the muscles at the measured pressures [N m].
        motion : float
            Torque that the model needs at this position, without inertia and damping [N m].
        speed : float
            Measured speed, filtered [rad/s].
        settings : ObserverSettings
            The present settings.
        """
        bandwidth = settings.bandwidth
        if math.isnan(self._muscles):
            self._muscles, self._motion, self._speed = muscles, motion, speed
            self._state = self.lost + self._inertia * bandwidth * speed
        if step <= 0.0:
            return self.lost
        # the torques pass the filter that the speed has passed
        self._muscles += step / (settings.speed_filter + step) * (muscles - self._muscles)
        late = settings.speed_filter + self._lag
        self._motion += step / (late + step) * (motion - self._motion)
        self._speed += step / (self._lag + step) * (speed - self._speed)
        momentum = self._inertia * bandwidth * self._speed
        unexplained = self._muscles - self._motion - self._damping * self._speed
        share = bandwidth * step / (1.0 + bandwidth * step)
        self._state += share * (unexplained + momentum - self._state)
        found = self._state - momentum
        self._smooth += step / (settings.speed_filter + step) * (found - self._smooth)
        self.lost = limited(self._smooth, -settings.limit, settings.limit)
        return self.lost
