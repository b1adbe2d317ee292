"""Whether a signal looks like that of a working sensor: steps, noise and range, without physics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pam_driver.boards.protocol import NEVER, Sample
from pam_driver.safety import limits_by_size as by_size
from pam_driver.safety.pressure_plausibility import Deviation
from pam_model.robot import Robot

# A step is remembered for this time, so that a single outlier is not forgotten before it is read
# [s].
_STEP_MEMORY: Final = 0.5
# Frames may arrive in bursts; a step within a burst may be as large as this time allows [s].
_SHORTEST_GAP: Final = 0.01
_LONGEST_GAP: Final = 0.1
_NOISE_MEMORY: Final = 25  # samples
_MEAN_SIZE: Final = math.sqrt(2.0 / math.pi)  # of Gaussian noise, over its sigma
_EVEN_SPREAD: Final = _MEAN_SIZE * math.sqrt(6.0)  # of `_noise_of`, with two equal gaps
# If two gaps differ by more than this factor, the host's timing distorts the noise estimate.
_EVEN_GAPS: Final = 2.5
_LOWEST_PRESSURE: Final = -20e3  # Pa gauge; no muscle is evacuated below ambient pressure


class _Signal:
    """One sensor's samples: the largest recent step, and the noise from second differences."""

    def __init__(self, step_per_gap: float, most_noise: float, share: float) -> None:
        self.noise = 0.0
        self.allowed, self.most_noise, self._share = step_per_gap, most_noise, share
        self._before = self._last = math.nan
        self._time = NEVER
        self._gap = math.nan
        self._step = 0.0
        self._step_at = NEVER

    def update(self, sample: Sample, now: float) -> bool:
        """Take a sample; whether step or noise is above the warning share of its limit."""
        if sample.time > self._time:
            self._take(sample.value, sample.time, now)
        return self.noise / self.most_noise > self._share or self.step(now) > self._share

    def _take(self, value: float, time: float, now: float) -> None:
        gap = time - self._time
        stretch = gap / self._gap
        self._time, self._gap = time, gap
        before, last = self._before, self._last
        if gap > _LONGEST_GAP:
            self._before, self._last = math.nan, value
            return
        self._before, self._last = last, value
        longer = gap / _SHORTEST_GAP
        step = abs(value - last) / (self.allowed * longer if longer > 1.0 else self.allowed)
        if step > self._step or now - self._step_at > _STEP_MEMORY:
            self._step, self._step_at = step, now
        if not math.isnan(before) and 1.0 / _EVEN_GAPS <= stretch <= _EVEN_GAPS:
            # Either the stamps or the samples are evenly spaced. Motion at constant speed appears
            # as noise under one of these assumptions at most, true noise under both.
            first, second = last - before, value - last
            even, sigma = abs(second - first) / _EVEN_SPREAD, _noise_of(first, second, stretch)
            # a single outlier must not count as noise
            sigma = min(even, sigma, 4.0 * self.noise + 0.1 * self.allowed)
            self.noise += (sigma - self.noise) / _NOISE_MEMORY

    def step(self, now: float) -> float:
        """The ratio of the largest recent step to the allowed step."""
        return self._step if now - self._step_at <= _STEP_MEMORY else 0.0


def _noise_of(first: float, second: float, stretch: float) -> float:
    """Standard deviation estimated from two steps; the second takes `stretch` times as long."""
    spread = math.sqrt(1.0 + (1.0 + stretch) ** 2 + stretch**2)
    return abs(second - first * stretch) / (_MEAN_SIZE * spread)


class SensorChecks:
    """Checks every sensor of a rig.

    Parameters
    ----------
    robot : Robot
        Its `plausibility` holds the limits.
    """

    def __init__(self, robot: Robot) -> None:
        self._limits = robot.plausibility
        self._robot = robot
        share = self._limits.warning_share
        self._pressures = tuple(
            _Signal(
                by_size.pressure_rate_limit(robot, one) * _SHORTEST_GAP,
                by_size.pressure_noise(robot, one),
                share,
            )
            for one in robot.muscles
        )
        self._positions = tuple(
            _Signal(by_size.position_jump(robot, one), by_size.position_noise(robot, one), share)
            for one in robot.joints
        )

    def update(
        self,
        pressures: Sequence[Sample],
        positions: Sequence[Sample],
        supply_pressures: Sequence[float],
        now: float,
    ) -> list[Deviation]:
        """Check the latest samples; the deviations above the warning share of their limit.

        Parameters
        ----------
        pressures, positions : sequence of Sample
            By muscle [Pa gauge] and joint [rad].
        supply_pressures : sequence of float
            By muscle [Pa absolute], NaN if unknown.
        now : float
            Monotonic time [s].
        """
        found: list[Deviation] = []
        share = self._limits.warning_share
        for place, (signal, sample) in enumerate(zip(self._pressures, pressures, strict=True)):
            if signal.update(sample, now) or sample.value / _LOWEST_PRESSURE > share:
                found += self._of_pressure(place, signal, sample.value, now)
        for place, (signal, sample) in enumerate(zip(self._positions, positions, strict=True)):
            if signal.update(sample, now):
                found += self._of_position(place, signal, now)
        found += self._supply(supply_pressures)
        return found

    def _of_pressure(
        self, place: int, signal: _Signal, pressure: float, now: float
    ) -> Iterator[Deviation]:
        """The deviations of a muscle's sensor."""
        name, share = self._robot.muscle_names[place], self._limits.warning_share
        size = signal.step(now)
        if size > share:
            text = f"pressure changed at {size * signal.allowed / _SHORTEST_GAP:.3g} Pa/s"
            yield Deviation("pressure_rate", name, size, text)
        size = signal.noise / signal.most_noise
        if size > share:
            yield Deviation("sensor_noise", name, size, f"noise {signal.noise:.0f} Pa")
        size = pressure / _LOWEST_PRESSURE
        if size > share:
            yield Deviation("sensor_range", name, size, f"{pressure:.0f} Pa gauge is impossible")

    def _of_position(self, place: int, signal: _Signal, now: float) -> Iterator[Deviation]:
        """The deviations of a joint's encoder."""
        name, share = self._robot.joints[place].name, self._limits.warning_share
        size = signal.step(now)
        if size > share:
            text = f"angle jumped by {size * signal.allowed:.3f} rad"
            yield Deviation("position_jump", name, size, text)
        size = signal.noise / signal.most_noise
        if size > share:
            yield Deviation("sensor_noise", name, size, f"noise {signal.noise:.4f} rad")

    def _supply(self, supply_pressures: Sequence[float]) -> Iterator[Deviation]:
        known = [pressure for pressure in supply_pressures if not math.isnan(pressure)]
        if not known:
            return
        gauge = min(known) - self._robot.gas.ambient_pressure
        lost = 1.0 - gauge / self._robot.supply_gauge_pressure
        allowed = 1.0 - self._limits.supply_share
        size = lost / allowed if allowed > 0.0 else math.inf * lost if lost > 0.0 else 0.0
        if size > self._limits.warning_share:
            text = f"supply is at {min(known):.0f} Pa absolute"
            yield Deviation("supply_low", "supply", size, text)
        highest = max(known) - self._robot.gas.ambient_pressure
        excess = highest / self._robot.supply_gauge_pressure - 1.0
        size = excess / (self._limits.supply_high_share - 1.0)
        if size > self._limits.warning_share:
            text = f"supply is at {max(known):.0f} Pa absolute"
            yield Deviation("supply_high", "supply", size, text)
