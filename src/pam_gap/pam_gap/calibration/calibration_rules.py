"""Hand-set constants of a calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pam_gap.prediction.fit import FreeParameter


@dataclass(frozen=True, slots=True)
class CalibrationRules:
    """Hand-set constants of a calibration; none of them changes a diagnosis."""

    # how far a written angle may be off [rad]: that of a protractor and the zero of the encoder
    angle: float = 0.1
    # standard deviation of the gain of a pressure sensor [-]; data sheets state 0.25 to 1 % of the
    # span
    sensor_gain: float = 0.006
    # standard deviation of its zero, over the gauge pressure of the supply [-]
    sensor_zero: float = 0.003
    # usual, usual_spread, usual_most: size of a small effect of a good rig: mean, standard
    # deviation and most, over the largest ordinary size in the file of the effect
    usual: float = 0.5
    usual_spread: float = 0.35
    usual_most: float = 1.5
    # standard deviation of the logarithm of a length or time that shapes such an effect
    usual_shape: float = 1.0
    reach: float = 1.2  # bounds of a fit, in tolerances from the written value
    # bounds of a missing number: this factor to either side of the first regression
    unknown_reach: float = 30.0
    # stage_steps, last_steps: largest number of steps of the fit of one stage, and of a fit of all
    # numbers together
    stage_steps: int = 12
    last_steps: int = 12
    # undamped_steps, settled: most undamped steps after that, and the fall of the log likelihood
    # that a step must promise
    undamped_steps: int = 4
    settled: float = 0.02
    # fits of all numbers together; each begins with the play of the valves that the one before has
    # found
    rounds: int = 2
    # time constant with which the pressures are corrected by the measured ones [s]: short, so that
    # an error of a valve does not pass on to the body
    horizon: float = 0.06
    # decrease of the mean log error in one step below which the fit of all numbers ends
    tolerance: float = 2e-4
    # difference, fine_step: step of the differences for the undamped steps and the intervals, in
    # typical changes of a number, and longest step of the integration for them [s]. With 0.4, the
    # curvature of each number looked like knowledge of the size of all lengths together.
    difference: float = 0.02
    fine_step: float = 5e-4
    # how far from the farthest measured angle a simulated joint may meet a stop [rad]
    stop_margin: float = 0.02
    # seconds up to which errors are correlated: a supply wanders, friction depends on the motion
    lags: int = 4
    # number of samples whose correlated errors say as much as one of independent errors; what was
    # known before the log has so much more weight in a fit
    correlation: float = 50.0
    # Factor of the deviations that the errors of the fit show: the laws of a real rig differ from
    # those of the simulation. It was set on drawn rigs of the seeds 21, 22 and 4601.
    discrepancy: float = 3.0
    # half width of the 90 % interval, relative, up to which a number counts as determined
    determined: float = 0.05
    determined_angle: float = 0.02  # the same for an angle [rad]
    # deviation of a number over that before the log, above which the log has said nothing of it
    narrowed: float = 0.7
    # The same for lengths and turns. Their ratios are known well from a log, so that each written
    # one says something of all of them. Whoever keeps one of them ignores what the others say.
    narrowed_length: float = 0.95
    # upper end of the band in which a pressure follows its command, and a force its pressure [Hz]
    slow_band: float = 5.0
    # least coherence of both valves in this band at which one is reversed and the other is not
    valve_coherence: float = 0.3
    withheld: float = 0.2  # share of a single recording that takes no part in the fit
    # RMS error of the fit over the motion of a channel, above which nothing is written
    misfit: float = 0.15

    def weighted(self, free: FreeParameter) -> FreeParameter:
        """A number as a fit takes it: what was known of it has the weight of `correlation`."""
        return replace(free, prior=free.prior / math.sqrt(self.correlation))


DEFAULT = CalibrationRules()
