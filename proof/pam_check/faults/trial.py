"""One fault on a moving joint: its detection, when valves and muscles are vented, the motion."""

from __future__ import annotations

import math
import random
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from pam_check.fault_kinds.fault_kind import LOWERING, STOPS, FaultKind, Reaction, Stays
from pam_check.fault_kinds.operator_kinds import HELD_LAYER
from pam_check.faults.chain import AMPLITUDE, STEP, TOP_SPEED, FaultChain
from pam_check.faults.injections import INJECTIONS
from pam_check.faults.rig_bounds import EMPTY, RigBounds, bounds_of
from pam_check.faults.unavoidable_speed import (
    HELD_ANGLE,
    RECOGNISED,
    burst_speed,
    stuck_valve_speed,
)
from pam_control.settings import ControlSettings
from pam_driver.safety.states import SafetyState
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.gravity import hanging_position
from pam_sim.faults.size_of_faults import ranges_on

AFTERWARDS = 0.3  # s, to check that the valves stay vented
SETTLING = 1.0  # s after the muscles are empty, for a joint that still swings
AT_REST = 0.05  # rad/s
GUARD_WAITS = ControlSettings().tracking_time  # s, with an error above max_tracking_error
ERROR_ALLOWED = 0.1  # rad, while the joint continues or until it stops
THROWN_ALLOWED = 0.05  # rad, of a joint that is lowered: it may sink, and not be thrown up
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
    empty_after : float or None
        Time from the fault until every muscle was truly below `EMPTY` and stayed there [s].
    peak_pressure, peak_force : float
        Highest pressure in any muscle [Pa gauge], and largest force of any muscle [N].
    peak_speed : float
        Highest true speed of the first joint from the fault on [rad/s].
    way : float
        Largest distance of the joint from where it was at the fault; from the vent on, if the
        valves vented [rad].
    thrown : float
        How much farther from the angle where it hangs a joint went than it was when the valves
        vented: muscles that empty unequally throw the arm up [rad].
    farthest : float
        The true angle that was farthest from 0 [rad].
    peak_error : float
        Largest deviation of the angle from its reference while air flowed [rad].
    off_since, off_for : float
        Since when this deviation is above `max_tracking_error` (infinite if it is not), and the
        longest time for which it was [s].
    message : str
        What the driver said, if the kind demands a message that names device and object.
    problem : str
        How the reaction differs from the stated one; empty if it does not.
    """

    kind: str
    values: dict[str, float]
    noticed: list[str] = field(default_factory=list)
    suspected_after: float | None = None
    stopped_after: float | None = None
    safe_after: float | None = None
    empty_after: float | None = None
    peak_pressure: float = 0.0
    peak_force: float = 0.0
    peak_speed: float = 0.0
    way: float = 0.0
    thrown: float = 0.0
    farthest: float = 0.0
    peak_error: float = 0.0
    off_since: float = math.inf
    off_for: float = 0.0
    message: str = ""
    problem: str = ""


def draw_values(kind: FaultKind, draw: random.Random, rig: Rig) -> dict[str, float]:
    """Draw the parameters of an injection uniformly, and often at an end of the range."""
    return {
        name: draw.choice((low, high)) if draw.randrange(ENDS) == 0 else draw.uniform(low, high)
        for name, (low, high) in ranges_on(kind.name, kind.parameters, rig).items()
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
    chain.after.append(lambda now: _note(trial, chain, seen))
    wanted = re.compile(kind.message)
    INJECTIONS[kind.name](chain, values, draw)
    start = last_air = chain.now  # some faults take acts before they happen
    origin = chain.truth.positions[0]
    hangs = hanging_position(compose(chain.rig).joints[0])
    bounds = bounds_of(chain.rig)
    vents = kind.reaction in STOPS
    lowering = LOWERING if kind.reaction is Reaction.LOWER else 0.0
    end = start + kind.bound + (lowering + bounds.exhaust_time + SETTLING if vents else 0.0)
    while chain.now < end:
        chain.step()
        truth = chain.truth
        angle = truth.positions[0]
        if chain.moves_air:
            last_air = chain.now
            if vents:
                origin, trial.way, trial.thrown = angle, 0.0, 0.0
        trial.way = max(trial.way, abs(angle - origin))
        if vents and not chain.moves_air and (angle - hangs) * (origin - hangs) > 0.0:
            trial.thrown = max(trial.thrown, abs(angle - hangs) - abs(origin - hangs))
        if max(truth.pressures) > EMPTY:
            trial.empty_after = None
        elif trial.empty_after is None:
            trial.empty_after = chain.now - start
        if chain.driver.suspicions and trial.suspected_after is None:
            trial.suspected_after = chain.now - start
        if trial.stopped_after is None and chain.driver.state is not SafetyState.ACTIVE:
            trial.stopped_after = chain.now - start
        trial.problem = trial.problem or _model_problem(chain)
        trial.message = trial.message or _message(chain, wanted)
        calm = chain.now - last_air > AFTERWARDS + STEP and abs(truth.velocities[0]) < AT_REST
        said = trial.message or not kind.message
        # a claim may be about what happens later
        if vents and calm and said and trial.empty_after is not None and not chain.claims:
            break
    if not chain.moves_air:
        trial.safe_after = last_air - start
    seen |= set(_counts(chain) - before)
    trial.noticed = sorted(seen)
    trial.problem = trial.problem or problem_of(chain, kind, trial)
    return trial


def _note(trial: Trial, chain: FaultChain, seen: set[str]) -> None:
    """Note what one step shows, also while a fault is still being prepared."""
    _look(chain, seen)
    truth = chain.truth
    trial.peak_pressure = max(trial.peak_pressure, *truth.pressures)
    trial.peak_force = max(trial.peak_force, *truth.forces)
    trial.peak_speed = max(trial.peak_speed, *map(abs, truth.velocities))
    trial.farthest = max(trial.farthest, truth.positions[0], key=abs)
    follows = chain.driver.state is SafetyState.ACTIVE and not chain.driver.lowers
    error = abs(truth.positions[0] - chain.reference) if chain.moves_air and follows else 0.0
    trial.peak_error = max(trial.peak_error, error)
    off = error > chain.rig.joints[0].max_tracking_error
    trial.off_since = min(trial.off_since, chain.now) if off else math.inf
    trial.off_for = max(trial.off_for, chain.now - trial.off_since)
    for claim in chain.claims:
        trial.problem = trial.problem or claim()


def _message(chain: FaultChain, wanted: re.Pattern[str]) -> str:
    """A message of the driver that contains the text which the kind demands; "" without one."""
    if not wanted.pattern:
        return ""
    driver = chain.driver
    texts = [str(one) for one in (*driver.faults, *driver.conditions)]
    texts += driver.last_frame_error.values()
    return next((text for text in texts if wanted.search(text)), "")


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
    bounds = bounds_of(chain.rig)
    must_be_noticed = kind.detected_by and kind.reaction is not Reaction.EITHER
    if must_be_noticed and not set(kind.detected_by) & set(trial.noticed):
        return f"noticed by {', '.join(trial.noticed) or 'nobody'}"
    if kind.message and not trial.message:
        return f"no message like {kind.message}"
    if kind.reaction in STOPS:
        problem = _venting_problem(kind, trial, bounds)
        if problem:
            return problem
    elif kind.reaction in {Reaction.RIDE, Reaction.WARN} and not (
        chain.moves_air and chain.driver.state is SafetyState.ACTIVE
    ):
        reasons = "; ".join(str(fault) for fault in chain.driver.faults)
        return f"stopped: {reasons or chain.driver.state.value}"
    return _error_problem(kind, trial, bounds) or _motion_problem(
        kind, trial, bounds, speed_bound(kind, trial.values, chain.rig, bounds)
    )


def _error_problem(kind: FaultKind, trial: Trial, bounds: RigBounds) -> str:
    if trial.peak_error > error_bound(kind, bounds):
        return f"angle off by {trial.peak_error:.3f} rad"
    if kind.stays is Stays.TRACKING and trial.off_for > GUARD_WAITS + STEP:
        return f"angle off by more than {bounds.tracking_error:g} rad for {trial.off_for:.2f} s"
    return ""


def _venting_problem(kind: FaultKind, trial: Trial, bounds: RigBounds) -> str:
    if trial.safe_after is None:
        return "not vented"
    stopped_after = math.inf if trial.stopped_after is None else trial.stopped_after
    bounds_driver = kind.bounds_driver or kind.reaction is Reaction.LOWER
    if bounds_driver and stopped_after > kind.bound + STEP:
        return f"the driver stopped after {1e3 * stopped_after:.0f} ms"
    # the valves of a board that hangs do not move until its own watchdog resets it
    valves_bound = max(kind.bound, trial.values.get("reset_after", 0.0))
    if kind.reaction is Reaction.LOWER:
        valves_bound += LOWERING
    if kind.reaction is Reaction.LOWER and bounds.heavy and trial.thrown > THROWN_ALLOWED:
        return f"thrown up by {trial.thrown:.2f} rad"
    if trial.safe_after > valves_bound + STEP:
        return f"vented after {1e3 * trial.safe_after:.0f} ms"
    empty_after = math.inf if trial.empty_after is None else trial.empty_after
    if not kind.keeps_air and empty_after > valves_bound + bounds.exhaust_time:
        return f"more than {1e-3 * EMPTY:.0f} kPa in a muscle for {empty_after:.2f} s"
    return ""


def speed_bound(kind: FaultKind, values: Mapping[str, float], rig: Rig, bounds: RigBounds) -> float:
    """Largest permitted speed [rad/s]: `max_velocity`, unless air that nothing stops gives more."""
    if not kind.air_drives:
        return bounds.speed
    angle = HELD_ANGLE if kind.layer == HELD_LAYER else AMPLITUDE
    hole = values.get("conductance")
    driven = (
        RECOGNISED * stuck_valve_speed(rig, angle)
        if hole is None
        else burst_speed(rig, hole, angle)
    )
    return max(bounds.speed, driven)


def _motion_problem(kind: FaultKind, trial: Trial, bounds: RigBounds, speed: float) -> str:
    """What exceeds the limits of the rig, whatever the fault is."""
    if trial.peak_speed > speed:
        return f"joint at {trial.peak_speed:.1f} rad/s"
    if not bounds.position[0] <= trial.farthest <= bounds.position[1]:
        return f"joint at {trial.farthest:.2f} rad"
    filled = kind.keeps_air  # by a valve that nothing shuts, perhaps up to the supply
    if trial.peak_pressure > (bounds.filled_pressure if filled else bounds.pressure):
        return f"{1e-3 * trial.peak_pressure:.0f} kPa in a muscle"
    if trial.peak_force > (bounds.filled_force if filled else bounds.force):
        return f"{trial.peak_force:.0f} N in a muscle"
    return ""


def error_bound(kind: FaultKind, bounds: RigBounds) -> float:
    """Largest permitted angle error [rad] of a moving joint during a fault of this kind.

    During a fault that is tolerated, or that may end either way, the joint stays near its
    reference. A fault that must vent may first take the joint as far away as the rig file permits
    it to be. Where the controller stops a joint that lags, the reference goes on until it does
    (`GUARD_WAITS`). If there are two sources of valid commands, it is unknown which one is
    right; then the joint may move anywhere within its position limits.
    """
    if kind.stays is Stays.IN_LIMITS:
        return max(map(abs, bounds.position)) + AMPLITUDE + ERROR_ALLOWED
    if kind.stays is Stays.TRACKING:
        return bounds.tracking_error + TOP_SPEED * GUARD_WAITS
    if kind.reaction in STOPS:
        return bounds.tracking_error
    return ERROR_ALLOWED
