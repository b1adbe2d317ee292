"""How well the joint should track with the numbers that were identified, and whether it does.

The tracking test is simulated on robots that are drawn from what the recordings say of all numbers
together, small effects and noise of the sensors included. A joint whose error is above that of all
of them has something that the numbers do not describe (a Monte Carlo test: Barnard, J. R. Stat.
Soc. B 25, 1963, p. 294; with 19 robots, one joint in twenty that is as described fails it).

The test is also simulated on the robot that is exactly as identified. This is what the joint could
do if its numbers were known: a controller that knows the numbers has nearly the same error on all
robots that the recordings permit, because this error comes from the small effects and the noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import spearmanr

from pam_demo.commission.robot_port import JointReading
from pam_demo.commission.simulated_port import SimulatedPort
from pam_demo.commission.tracking import Tracked
from pam_gap.calibration.answer import what_would_help
from pam_gap.calibration.calibration import CalibratedNumber, Calibration
from pam_gap.calibration.posterior import Posterior
from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION
from pam_model.rig import Rig

ROBOTS: Final = 19
WORSE: Final = 1.5
"""Error over that with known numbers, above which more should be known of them [-]."""
TIMES: Final = 4
"""How often the test is simulated on the robot that is as identified, with noise of its own."""
NAMED: Final = 2
"""Numbers that are named as doubtful."""


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of the white noise: of the angle [rad], of both pressures [Pa]."""

    position: float
    pressures: tuple[float, float]


@dataclass(slots=True)
class NoisyPort:
    """A simulated robot whose sensors are noisy."""

    port: SimulatedPort  # the robot
    noise: SensorNoise  # of its sensors
    random: np.random.Generator  # of the noise
    # period, measurement_delay, command_delay: those of the port [s]
    period: float = 0.0
    measurement_delay: float = 0.0
    command_delay: float = 0.0

    def __post_init__(self) -> None:
        """Take times and delays from the port."""
        self.period = self.port.period
        self.measurement_delay = self.port.measurement_delay
        self.command_delay = self.port.command_delay

    def advance(self, commands: Sequence[float]) -> JointReading:
        """As of every `RobotPort`."""
        reading = self.port.advance(commands)
        angle, first, second = self.random.normal(size=3).tolist()
        here, there = self.noise.pressures
        return reading._replace(
            position=reading.position + self.noise.position * angle,
            pressures=(reading.pressures[0] + here * first, reading.pressures[1] + there * second),
        )


@dataclass(frozen=True, slots=True)
class Expected:
    """What the tracking test gives on robots that the recordings permit."""

    # RMS error on each of them [rad], the smallest first; infinite where it was not followed
    errors: tuple[float, ...]
    # keys of the numbers on which the error depends most, the first one most
    doubtful: tuple[str, ...]
    known: float  # RMS error where the numbers are exactly those of the robot [rad]


def expected(
    rig: Rig,
    posterior: Posterior,
    noise: SensorNoise,
    period: float,
    test: Callable[[NoisyPort], Tracked],
) -> Expected:
    """Make the tracking test on robots that the recordings permit, and on the one identified.

    Parameters
    ----------
    rig : Rig
        The identified rig of the joint.
    posterior : Posterior
        What the recordings say of all its numbers together.
    period : float
        Of the commands [s].
    test : callable
        The tracking test on a port.
    """
    random = np.random.default_rng(0)
    robots = posterior.robots(ROBOTS, random)

    def error(robot: Mapping[str, float]) -> float:
        return test(NoisyPort(SimulatedPort(rig, period, robot), noise, random)).rms

    errors = [error(robot) for robot in robots]
    known = float(np.mean([error(posterior.identified) for _ in range(TIMES)]))
    stated = [one for one in posterior.numbers if not (one.is_ordinary or one.is_sensor)]
    influence = {
        one.key: abs(float(spearmanr([robot[one.name] for robot in robots], errors).statistic))
        for one in stated
    }
    keys = sorted(influence, key=lambda key: -np.nan_to_num(influence[key]))[:NAMED]
    return Expected(tuple(sorted(errors)), tuple(keys), known)


def noise_of(calibration: Calibration) -> SensorNoise:
    """The white noise of the sensors in the recordings of a calibration; none without them."""
    problem = calibration.problem
    if problem is None:
        return SensorNoise(0.0, (0.0, 0.0))
    found = np.sqrt(np.mean([data.deviation**2 for data in problem.data], axis=0))
    first, second = found[BOTH_PRESSURES].tolist()
    return SensorNoise(float(found[POSITION]), (first, second))


def doubt(measured: float, on_robots: Expected, numbers: Sequence[CalibratedNumber]) -> str:
    """Why the tracking is not as good as it should be, and what to do; empty if it is.

    Parameters
    ----------
    measured : float
        RMS error of the tracking test [rad].
    on_robots : Expected
        The same test on robots that the recordings permit.
    numbers : sequence of CalibratedNumber
        Of the last identification.
    """
    by_key = {one.key: one for one in numbers}
    names = [
        f"{key} ({what_would_help(by_key[key])})" for key in on_robots.doubtful if key in by_key
    ]
    ends = f"{1e3 * on_robots.errors[0]:.2f} to {1e3 * on_robots.errors[-1]:.2f} mrad"
    if not math.isfinite(on_robots.errors[-1]):
        ends = f"{1e3 * on_robots.errors[0]:.2f} mrad to a test that is not followed to its end"
    if measured > on_robots.errors[-1]:
        return (
            f"The joint tracks with {1e3 * measured:.2f} mrad RMS, which is worse than its numbers "
            f"predict ({ends}): one of them is wrong, or something acts on "
            f"the joint that no number describes. The error depends most on {' and '.join(names)}; "
            "what is in brackets would determine them. Then diagnose the recordings with "
            "`pam gap diagnose`."
        )
    if measured > WORSE * on_robots.known:
        return (
            f"The joint tracks with {1e3 * measured:.2f} mrad RMS, and a robot with exactly these "
            f"numbers would track with {1e3 * on_robots.known:.2f} mrad: they are not exact (what "
            f"is known of them leaves {ends} open), or something acts on the joint that no number "
            f"describes. The error depends most on {' and '.join(names)}; "
            "what is in brackets would determine them."
        )
    return ""
