"""The baseline: PID on the pressure difference with feedforward, tuned on the rig it runs on.

A patient person at the real joint would do the same in an afternoon: fit the feedforward to the
pressures that the joint needed in the same motions, then try gains until the error does not become
smaller. The search is Nelder and Mead's over the logarithms of the three gains; its cost is the
geometric mean of the RMS errors of all motions, and it begins with the gains that are designed from
the rig file or with a half, a quarter or an eighth of them, whichever is best once the feedforward
is fitted. Limit cycles and stops count as large errors. The pressure loops below the PID remain as
they are designed from the rig file, with the inverse of the valve and of the gas, unless they are
tuned as well.

A PID without reserve would be no baseline: a simulation, unlike a joint, can be tuned to the edge
of instability. Therefore the joint must also come to rest after a reach with twice the gains, which
is the least gain margin that textbooks recommend (K. J. Astrom and T. Hagglund, Advanced PID
Control, ISA 2006, section 4.6: 2 to 5).

The tuned law has no guard: what a person tunes by hand is not softened while it runs.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pam_check.blind.plants import FIRST
from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import (
    LIMIT_CYCLE,
    SETTLED,
    TOLD,
    Muscles,
    PlayedRun,
    RunTrace,
    play,
)
from pam_control.controller import Controller
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.pid import PidGains
from pam_control.laws.pressure_difference_pid import PressureDifferencePid
from pam_control.loop_guard import GuardAction, LoopGuard, Means
from pam_control.prepared_settings import Loops, PreparedSettings
from pam_control.references.trajectory import TrajectoryPoint
from pam_model.rig import Rig

FITS: Final = 2
LAW: Final = PressureDifferencePid()
FIRST_FACTORS: Final = (1.0, 0.5, 0.25, 0.125)
LARGEST_ERROR: Final = 0.5  # rad; of a run that stopped
RESERVE: Final = 2.0  # times all gains, with which the joint must still come to rest
REACH: Final = (TrajectoryPoint(0.4, [0.3], [0.0], [0.0]),)
FIRST_STEP: Final = math.log(1.8)
Motions = Mapping[str, Sequence[TrajectoryPoint]]
Coefficients = tuple[float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class TunedPid:
    """What was found.

    Attributes
    ----------
    gains : (float, float, float)
        Proportional [N m/rad], integral [N m/(rad s)], derivative [N m s/rad].
    pressure_gain : float
        [1/s].
    feedforward : tuple of five floats
        As `DifferenceFeedforward`.
    tried : int
        Number of gains that were tried on all motions.
    """

    gains: tuple[float, float, float]
    pressure_gain: float
    feedforward: Coefficients
    tried: int = 0


class _NoGuard(LoopGuard):
    def judge(self, time: float, telemetry: Any, tracking_time: float, means: Means) -> GuardAction:
        return GuardAction.NOTHING


class TuningBench:
    """One rig, on which gains are tried.

    Parameters
    ----------
    rig : Rig
        The rig file, which does not know what is hidden.
    joint, muscles : TruthJoint, Muscles
        The true rig.
    motions : mapping
        By name.
    seed : int
        Of the sensors' noise.
    designs : KeptDesigns
        Store of the gains to begin with.
    plant : str, optional
        Which has the true rig.
    """

    def __init__(
        self,
        rig: Rig,
        joint: TruthJoint,
        muscles: Muscles,
        motions: Motions,
        seed: int,
        designs: KeptDesigns,
        plant: str = FIRST,
    ) -> None:
        self._true, self._plant = (joint, muscles), plant
        self._motions, self._seed = motions, seed
        self._name = rig.joints[0].name
        self._controller = Controller(rig, TOLD, designs, LAW)
        self._controller.guard = _NoGuard(self._controller.robot.joints)
        self.tried = 0

    def first(self) -> TunedPid:
        """The gains and the feedforward that follow from the rig file."""
        settings = self._controller.settings
        (gains,) = settings.gains[self._name].gains
        models = self._controller.channels[0].models
        coefficients = dataclasses.astuple(LAW.feedforward(models, settings))
        return TunedPid(
            (gains.proportional, gains.integral, gains.derivative),
            settings.pressure_gain or 1.0,
            coefficients,
        )

    def play(self, tuned: TunedPid) -> dict[str, tuple[PlayedRun, RunTrace]]:
        """Play all motions."""
        self._use(tuned)
        self.tried += 1
        joint, muscles = self._true
        return {
            name: play(self._controller, joint, muscles, points, self._seed, plant_name=self._plant)
            for name, points in self._motions.items()
        }

    def _use(self, tuned: TunedPid) -> None:
        settings = TOLD.replace(
            gains={
                self._name: GainSchedule.constant(PidGains(*tuned.gains, TOLD.derivative_filter))
            },
            pressure_gain=tuned.pressure_gain,
        )
        # not through `prepare`: that would refuse gains which are unsafe on the nominal rig
        loops = Loops(settings, self._controller.prepared.normal.margins)
        law = PressureDifferencePid(given={self._name: tuned.feedforward})
        self._controller.use(PreparedSettings(settings, law, loops, None))

    @staticmethod
    def fitted(tuned: TunedPid, runs: Mapping[str, tuple[PlayedRun, RunTrace]]) -> TunedPid:
        """The same gains with the feedforward that runs with them have shown to be needed."""
        return dataclasses.replace(tuned, feedforward=_fitted([t for _, t in runs.values()]))

    @staticmethod
    def scaled(tuned: TunedPid, factor: float) -> TunedPid:
        """All gains times a factor."""
        kp, ki, kd = (factor * gain for gain in tuned.gains)
        return dataclasses.replace(
            tuned, gains=(kp, ki, kd), pressure_gain=factor * tuned.pressure_gain
        )

    def cost(self, tuned: TunedPid) -> float:
        """Logarithm of the geometric mean of the errors, and what lacks of the reserve."""
        runs = self.play(tuned)
        return self.cost_of(tuned, {name: played for name, (played, _) in runs.items()})

    def cost_of(self, tuned: TunedPid, played: Mapping[str, PlayedRun]) -> float:
        """The cost of gains whose runs are known."""
        self._use(self.scaled(tuned, RESERVE))
        reached, _ = play(self._controller, *self._true, REACH, self._seed)
        rest = LARGEST_ERROR if reached.stopped else reached.limit_cycle
        return _cost(played) + max(math.log(rest / LIMIT_CYCLE), 0.0)


def _cost(played: Mapping[str, PlayedRun]) -> float:
    logs = []
    for each in played.values():
        error = LARGEST_ERROR if each.stopped else min(each.rms, LARGEST_ERROR)
        logs.append(math.log(max(error, each.limit_cycle) if not each.stopped else error))
    return float(np.mean(logs))


def _fitted(traces: Sequence[RunTrace]) -> Coefficients:
    """Least squares of half the measured pressure difference on the reference's polynomial."""
    rows, wanted = [], []
    for trace in traces:
        used = np.isfinite(trace.position)
        used[: round(0.7 * SETTLED / TOLD.period)] = False
        q, qd, qdd = trace.reference[used].T
        rows.append(np.stack([np.ones_like(q), q, q**3, qd, qdd], axis=1))
        wanted.append(0.5 * (trace.pressures[used, 0] - trace.pressures[used, 1]))
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(wanted), rcond=None)[0]
    c0, c1, c2, c3, c4 = found.tolist()
    return c0, c1, c2, c3, c4


def tune(bench: TuningBench, tries: int, pressure_loops: bool) -> TunedPid:
    """The best gains and feedforward that are found with about this number of tries.

    Parameters
    ----------
    bench : TuningBench
        The rig.
    tries : int
        Number of gains that are tried.
    pressure_loops : bool
        Whether the gain of the pressure loops is tuned as well.
    """
    from scipy.optimize import minimize  # noqa: PLC0415  (slow to import)

    def judged(tuned: TunedPid) -> tuple[TunedPid, float, Any]:
        runs = bench.play(tuned)
        return tuned, bench.cost_of(tuned, {name: each for name, (each, _) in runs.items()}), runs

    def refit(best: TunedPid, least: float, runs: Any) -> tuple[TunedPid, float, Any]:
        for _ in range(FITS):
            new = judged(bench.fitted(best, runs))
            if new[1] >= least:
                break
            best, least, runs = new
        return best, least, runs

    def scaled(tuned: TunedPid, factors: Sequence[float]) -> TunedPid:
        kp, ki, kd = (g * f for g, f in zip(tuned.gains, factors[:3], strict=True))
        pressure_gain = tuned.pressure_gain * math.prod(factors[3:])
        return dataclasses.replace(tuned, gains=(kp, ki, kd), pressure_gain=pressure_gain)

    # A joint that swings does not show the pressures that it needs: calmer gains may begin better.
    first = bench.first()
    starts = [refit(*judged(scaled(first, [factor] * 3))) for factor in FIRST_FACTORS]
    best, least, runs = min(starts, key=lambda start: start[1])
    start = best
    count = 4 if pressure_loops else 3
    corner = np.zeros(count)
    steps = FIRST_STEP * np.array([1.0, 1.0, 1.0, -1.0])[:count]
    simplex = np.vstack([corner, np.diag(steps)])
    options: Any = {"maxfev": tries, "initial_simplex": simplex, "xatol": 0.03, "fatol": 0.005}

    def at(exponents: Any) -> TunedPid:
        return scaled(start, np.exp(np.clip(exponents, -4.0, 4.0)).tolist())

    def cost(exponents: Any) -> float:
        return bench.cost(at(exponents))

    found = minimize(cost, corner, method="Nelder-Mead", options=options)
    if found.fun < least:
        best, least, runs = judged(at(found.x))
    best, _, _ = refit(best, least, runs)
    return dataclasses.replace(best, tried=bench.tried)
