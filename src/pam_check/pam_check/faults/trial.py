"""One fault on a moving joint: its detection, the time until valves vented, the joint's motion."""

from __future__ import annotations

import math
import random
from collections import Counter
from dataclasses import dataclass, field

from pam_check.faults import host_faults
from pam_check.faults.chain import AMPLITUDE, STEP, FaultChain
from pam_driver.safety.states import SafetyState
from pam_model.rig import Rig
from pam_sim import fault_injection
from pam_sim.faults.kinds import FaultKind, Reaction

AFTERWARDS = 0.3  # s, to check that the valves stay vented
ERROR_ALLOWED = 0.1  # rad, while the joint continues or until it stops
# One draw in this many is an end of the range, where the slowest and hardest cases are.
ENDS = 4


@dataclass(slots=True)
class Trial:
    """Result of one injection.

    Attributes
    ----------
    kind : str
        Name of the fault.
    values : dict
        Its drawn parameters.
    noticed : list of str
        All detections.
    suspected_after : float or None
        Time from the fault until the driver reported a suspicion [s].
    stopped_after : float or None
        Time from the fault until the driver left its active state [s].
    safe_after : float or None
        Time from the fault until the valves vented and stayed vented [s].
    peak_pressure : float
        Highest pressure in any muscle [Pa gauge].
    peak_error : float
        Largest deviation of the angle from its reference while air flowed [rad].
    problem : str
        How the reaction differs from the stated one; empty if it does not.
    """

    kind: str
    values: dict[str, float]
    noticed: list[str] = field(default_factory=list)
    suspected_after: float | None = None
    stopped_after: float | None = None
    safe_after: float | None = None
    peak_pressure: float = 0.0
    peak_error: float = 0.0
    problem: str = ""


def draw_values(kind: FaultKind, draw: random.Random) -> dict[str, float]:
    """Draw the parameters of an injection uniformly, and often at an end of the range."""
    return {
        name: draw.choice((low, high)) if draw.randrange(ENDS) == 0 else draw.uniform(low, high)
        for name, (low, high) in kind.parameters.items()
    }


def run_trial(chain: FaultChain, kind: FaultKind, values: dict[str, float], seed: int) -> Trial:
    """Inject a fault into a moving chain and observe the reaction.

    Parameters
    ----------
    chain : FaultChain
        A started chain, which cannot be used afterwards.
    kind : FaultKind
        The fault.
    values : dict
        Its parameters.
    seed : int
        Seed for the random choice of board, sensor and sign.
    """
    trial = Trial(kind.name, values)
    draw = random.Random(seed)
    before = _counts(chain)
    seen: set[str] = set()
    start = chain.now
    if kind.name in host_faults.INJECTIONS:
        host_faults.INJECTIONS[kind.name](chain, values, draw)
    else:
        fault_injection.inject(chain, kind.name, values, draw)
    last_air = start
    vents = kind.reaction is Reaction.VENT
    end = start + kind.bound + (0.5 if vents else 0.0)
    while chain.now < end:
        chain.step()
        if chain.moves_air:
            last_air = chain.now
            error = chain.truth.positions[0] - chain.reference
            trial.peak_error = max(trial.peak_error, abs(error))
        elif vents and chain.now - last_air > AFTERWARDS + STEP:
            break
        trial.peak_pressure = max(trial.peak_pressure, *chain.truth.pressures)
        _look(chain, seen)
        if chain.driver.suspicions and trial.suspected_after is None:
            trial.suspected_after = chain.now - start
        if trial.stopped_after is None and chain.driver.state is not SafetyState.ACTIVE:
            trial.stopped_after = chain.now - start
        trial.problem = trial.problem or _model_problem(chain)
    if not chain.moves_air:
        trial.safe_after = last_air - start
    seen |= set(_counts(chain) - before)
    trial.noticed = sorted(seen)
    trial.problem = trial.problem or problem_of(chain, kind, trial)
    return trial


def _counts(chain: FaultChain) -> Counter[str]:
    counts: Counter[str] = Counter()
    for board in chain.driver.boards.values():
        counts.update(board.counts())
    counts["frame_errors"] = sum(chain.driver.frame_errors.values())
    return counts + chain.port.counts + chain.noticed


def _look(chain: FaultChain, seen: set[str]) -> None:
    driver = chain.driver
    if driver.faults:
        seen.update(fault.kind for fault in driver.faults)
    if driver.suspicions:
        seen.update(f"suspected {suspicion.kind}" for suspicion in driver.suspicions)
    for board in chain.sim.boards.values():
        seen.update(board.fault_names)
    if chain.reason:
        seen.add("controller")
    if chain.estimate.problems:
        seen.add("model")


def _model_problem(chain: FaultChain) -> str:
    """The model must publish NaN instead of an estimate from old measurements."""
    estimate = chain.estimate
    values = (*estimate.joint_torques, *estimate.joint_stiffnesses, *estimate.muscle_forces)
    if any(math.isinf(value) for value in values):
        return "the model publishes an infinite number"
    if chain.estimate_age > chain.model.max_age and any(map(math.isfinite, values)):
        return "the model publishes an old estimate"
    return ""


def problem_of(chain: FaultChain, kind: FaultKind, trial: Trial) -> str:
    """How the reaction in a finished trial differs from the stated one; empty if it does not."""
    must_be_noticed = kind.detected_by and kind.reaction is not Reaction.EITHER
    if must_be_noticed and not set(kind.detected_by) & set(trial.noticed):
        return f"noticed by {', '.join(trial.noticed) or 'nobody'}"
    if kind.reaction is Reaction.VENT:
        return _venting_problem(kind, trial)
    if kind.reaction in {Reaction.RIDE, Reaction.WARN} and not (
        chain.moves_air and chain.driver.state is SafetyState.ACTIVE
    ):
        reasons = "; ".join(str(fault) for fault in chain.driver.faults)
        return f"stopped: {reasons or chain.driver.state.value}"
    if trial.peak_error > error_bound(kind, chain.rig):
        return f"angle off by {trial.peak_error:.3f} rad"
    return ""


def _venting_problem(kind: FaultKind, trial: Trial) -> str:
    if trial.safe_after is None:
        return "not vented"
    if kind.bounds_driver and (trial.stopped_after or math.inf) > kind.bound + STEP:
        return f"the driver stopped after {1e3 * (trial.stopped_after or math.inf):.0f} ms"
    # the valves of a board that hangs do not move until its own watchdog resets it
    valves_bound = max(kind.bound, trial.values.get("reset_after", 0.0))
    if trial.safe_after > valves_bound + STEP:
        return f"vented after {1e3 * trial.safe_after:.0f} ms"
    return ""


def error_bound(kind: FaultKind, rig: Rig) -> float:
    """Largest permitted angle error [rad] of a moving joint during a fault of this kind.

    During a fault that is tolerated, the joint must stay near its reference. If there are two
    sources of valid commands, it is unknown which one is right; then the joint may move anywhere
    within its position limits.
    """
    if not kind.to_the_limits:
        return ERROR_ALLOWED
    return max(map(abs, rig.joints[0].position_limits)) + AMPLITUDE + ERROR_ALLOWED
