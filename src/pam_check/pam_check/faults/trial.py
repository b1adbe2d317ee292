"""One fault on a moving joint: what noticed it, when the valves were vented, what the joint did."""

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

AFTERWARDS = 0.3  # s, to see that a vent stays
ERROR_ALLOWED = 0.1  # rad, of a joint that goes on, or until it stops
# One draw in so many is an end of its range: there are the slowest and the hardest cases.
ENDS = 4


@dataclass(slots=True)
class Trial:
    """What came of one injection.

    Attributes
    ----------
    kind : str
        Of the fault.
    values : dict
        Its parameters, drawn.
    noticed : list of str
        Everything that noticed anything.
    suspected_after : float or None
        From the fault until the driver named a suspicion [s].
    stopped_after : float or None
        From the fault until the driver left its active state [s].
    safe_after : float or None
        From the fault until valves vented and stayed so [s].
    peak_pressure : float
        In any muscle [Pa gauge].
    peak_error : float
        Of the angle against its reference, while air moved [rad].
    problem : str
        Why it is not as promised; empty if it is.
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
    """The parameters of an injection: even over their ranges, and often at an end of one."""
    return {
        name: draw.choice((low, high)) if draw.randrange(ENDS) == 0 else draw.uniform(low, high)
        for name, (low, high) in kind.parameters.items()
    }


def run_trial(chain: FaultChain, kind: FaultKind, values: dict[str, float], seed: int) -> Trial:
    """Bring a fault about on a chain that moves, and watch.

    Parameters
    ----------
    chain : FaultChain
        Started; spent afterwards.
    kind : FaultKind
        What is injected.
    values : dict
        Its parameters.
    seed : int
        Of what the injection draws: board, sensor, sign.
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
    """A model must say that it knows nothing rather than tell what was true before."""
    estimate = chain.estimate
    told = (*estimate.joint_torques, *estimate.joint_stiffnesses, *estimate.muscle_forces)
    if any(math.isinf(value) for value in told):
        return "the model tells an infinite number"
    if chain.estimate_age > chain.model.max_age and any(map(math.isfinite, told)):
        return "the model tells what is old"
    return ""


def problem_of(chain: FaultChain, kind: FaultKind, trial: Trial) -> str:
    """Why a trial that is over did not go as its kind promises; empty if it did."""
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
    # the valves of a board that hangs stay as they are until its own watchdog resets it
    valves_bound = max(kind.bound, trial.values.get("reset_after", 0.0))
    if trial.safe_after > valves_bound + STEP:
        return f"vented after {1e3 * trial.safe_after:.0f} ms"
    return ""


def error_bound(kind: FaultKind, rig: Rig) -> float:
    """Largest angle error [rad] of a joint that moves while a fault of this kind is there.

    A fault that is ridden through must leave the joint near its reference. Of two sources of valid
    commands nobody can tell which one is right; then the joint may go as far as `position_limit`
    lets it.
    """
    if not kind.to_the_limits:
        return ERROR_ALLOWED
    return max(map(abs, rig.joints[0].position_limits)) + AMPLITUDE + ERROR_ALLOWED
