"""One cycle of the model-based law, for the rows of all joints.

The parts of the plan are functions of one joint's rows (`plan_rows`). `plan_parts` goes through
them for joints whose muscles are in closed form; for other muscles, and for a motion that is being
learnt, the law stops between two parts and lets Python compute what is lacking.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.adaptation.stiffness_estimate import EVERY as ESTIMATE_EVERY
from pam_control.adaptation.torque_adaptation import learnt_torque, move_reference, take_torque
from pam_control.compensation.dry_friction import friction_change
from pam_control.compensation.history_torque import history_torque
from pam_control.feedback.disturbance_observer import observed_loss
from pam_control.feedback.pid import hand_over
from pam_control.feedback.stuck_integral import given_back, keep_handed
from pam_control.limited import limited
from pam_control.plan_memory import (
    measure,
    newest,
    planned_at,
    planned_rate,
    remember,
    shown_pressure,
    value_at,
)
from pam_control.rows.plan_rows import (
    A_DELAY,
    A_FRICTION,
    A_KNOWS,
    J_IN_CLOSED_FORM,
    J_KEPT,
    J_LAG,
    J_POSITION_HIGH,
    J_POSITION_LOW,
    P_KNOWN,
    P_MEASURED,
    P_MEMORY,
    P_PRESSURES,
    P_STIFFNESS,
    S_ADAPTATION_LIMIT,
    S_ADAPTS,
    S_FEEDFORWARD,
    S_OBSERVER_LIMIT,
    S_SPEED_FILTER,
    S_STIFFNESS_RATE,
    W_ACTS,
    W_AHEAD,
    W_AT_SEEN,
    W_BEFORE,
    W_DESIRED,
    W_HIGH,
    W_LAGGING,
    W_LINE,
    W_LOW,
    W_MOST,
    W_PLANNED,
    W_PRESSURE,
    W_RATE,
    W_REACHED,
    W_REFERENCE,
    W_SHIFT,
    W_SHOWN,
    W_SPEED,
    X_ADDED,
    X_ASKED_POSITION,
    X_ASKED_STIFFNESS,
    X_ASKED_TORQUE,
    X_BASE,
    X_BESIDE,
    X_CORRECTION,
    X_DISTURBANCE,
    X_ESTIMATE_DUE,
    X_EXPLAINED,
    X_FACTOR,
    X_FRESH,
    X_GRIP,
    X_HANDED,
    X_INSIDE,
    X_INTEGRAL,
    X_IS_DUE,
    X_IS_OBSERVED,
    X_KNOWN,
    X_LAGGING_INSIDE,
    X_LOST,
    X_MEASURED_AT,
    X_MISSED,
    X_NEW_INTEGRAL,
    X_NOW,
    X_OBSERVER,
    X_OUTPUT,
    X_PAST_STIFFNESS,
    X_PLANNED_TORQUE,
    X_POSITION,
    X_REACHED_STIFFNESS,
    X_REACHED_TORQUE,
    X_SEEN,
    X_STIFFNESS,
    X_STIFFNESS_LIMITED,
    X_TORQUE,
    X_TORQUE_BEFORE,
    X_TORQUE_LAGGING,
    X_TORQUE_LIMITED,
    X_TORQUE_SEEN,
    X_TRUE_STIFFNESS,
    X_UNEXPLAINED,
    X_USUAL,
    X_VELOCITY,
    X_WANTED,
    Y_ADAPTED,
    Y_GRIP,
    Y_HANDED,
    Y_LAGGING,
    Y_LAGGING_SPEED,
    Y_SINCE_ESTIMATE,
    Y_STIFFNESS,
    Y_ZERO,
)
from pam_model.joints.muscle_inverse import L_PRESSURE
from pam_model.plant.compiled import entry_point
from pam_model.plant.composition import dry_friction
from pam_model.views.joint_rows import (
    gravity,
    gravity_rate,
    motion_torque,
    moving_torque,
    muscles_torques,
    pressures_for,
    static_torque,
)

RATE_SPAN: Final = 0.01  # s, over which the rate of the muscles' torque is taken
OBSERVE, AHEAD, NOW, AIM, REACHED = range(5)
"""The parts of a plan. OBSERVE: pressures at the time of the position, torques that are known and
learnt. AHEAD: the pressures for the time when the valves act. NOW: what those of now lack, and
what is learnt from it. AIM: torque and stiffness for now. REACHED: the plan."""
RESUME: Final = 5
"""From AIM on, the joints that have stopped there because something of them is due."""


def compares(s: Any, x: Any) -> bool:
    """Whether the torque of the muscles is compared with the motion."""
    return bool(s[S_ADAPTS] > 0.0 or x[X_IS_OBSERVED] > 0.0)


def inside(j: Any, position: float) -> float:
    """The position [rad] limited to the range of the muscles' models."""
    return limited(position, j[J_POSITION_LOW], j[J_POSITION_HIGH])


def reach(c: Any, j: Any, w: Any, x: Any, table: Any) -> None:
    """Find the pressures for what is asked for, of muscles in closed form."""
    torque, stiffness, cut, soft = pressures_for(
        c, table, w, W_LINE, W_LOW, W_HIGH,
        inside(j, x[X_ASKED_POSITION]), x[X_ASKED_TORQUE], x[X_ASKED_STIFFNESS],
    )  # fmt: skip
    for k in range(len(w)):
        w[k][W_REACHED] = w[k][W_LINE + L_PRESSURE]
    x[X_REACHED_TORQUE], x[X_REACHED_STIFFNESS] = torque, stiffness
    x[X_TORQUE_LIMITED], x[X_STIFFNESS_LIMITED] = 1.0 if cut else 0.0, 1.0 if soft else 0.0


def needed_torque(c: Any, row: Any, at: int) -> float:
    """Torque [N m] for the reference of a moment in a row, without dry friction."""
    return motion_torque(c, row[at + 1], row[at + 2], row[at + 3])


def last_to_act(w: Any) -> int:
    """The muscle whose valve acts last."""
    last = 0
    for k in range(1, len(w)):
        if w[k][W_ACTS] > w[last][W_ACTS]:
            last = k
    return last


def observe(
    c: Any, j: Any, s: Any, w: Any, x: Any, y: Any, a: Any, memory: Any, plans: Any, plan_ends: Any,
    samples: Any, sample_ends: Any,
) -> None:  # fmt: skip
    """Pressures at the time of the position; torques that are known and learnt."""
    if compares(s, x) or x[X_OBSERVER] > 0.0:
        measure(samples, sample_ends, x[X_MEASURED_AT], w, W_PRESSURE, j[J_KEPT])
    x[X_INSIDE] = inside(j, x[X_POSITION])
    if x[X_OBSERVER] > 0.0:
        for k in range(len(w)):
            w[k][W_AT_SEEN] = value_at(samples, sample_ends, x[X_SEEN], P_MEASURED + k, 1.0)
    if compares(s, x):
        # the motion with the lag of the pressure sensors, so that both fit
        if j[J_LAG] == 0.0 or math.isnan(y[Y_LAGGING]):
            y[Y_LAGGING], y[Y_LAGGING_SPEED] = x[X_POSITION], x[X_VELOCITY]
        else:
            weight = x[X_FRESH] / (j[J_LAG] + x[X_FRESH])
            y[Y_LAGGING] += weight * (x[X_POSITION] - y[Y_LAGGING])
            y[Y_LAGGING_SPEED] += weight * (x[X_VELOCITY] - y[Y_LAGGING_SPEED])
        x[X_LAGGING_INSIDE] = inside(j, y[Y_LAGGING])
        # by the rig file, without the learnt delay
        at = x[X_SEEN] + max(a[A_DELAY], 0.0)
        for k in range(len(w)):
            field = P_MEASURED + k
            w[k][W_LAGGING] = value_at(samples, sample_ends, at, field, 1.0)
            w[k][W_BEFORE] = value_at(samples, sample_ends, at - RATE_SPAN, field, 1.0)
    then = w[last_to_act(w)]
    time, position, velocity = then[W_ACTS], then[W_ACTS + 1], then[W_ACTS + 2]
    push = then[W_ACTS + 3]
    for k in range(len(w)):
        if plan_ends[1] > 0:
            w[k][W_PLANNED] = plans[newest(plans, plan_ends)][P_PRESSURES + k]
        else:
            w[k][W_PLANNED] = w[k][W_SHOWN] = w[k][W_DESIRED]
    x[X_KNOWN] = history_torque(c, j, w, y, memory, time, position, velocity, push)
    x[X_USUAL] = 0.0
    if s[S_ADAPTS] > 0.0:
        move_reference(y, a, time, position)
        y[Y_ZERO] = y[Y_STIFFNESS] + gravity_rate(c, position)
        x[X_USUAL] = learnt_torque(y, a, then, W_ACTS, s[S_ADAPTATION_LIMIT])
    x[X_BASE], x[X_CORRECTION] = x[X_USUAL], 0.0


def measured_torques(c: Any, s: Any, w: Any, x: Any, table: Any) -> None:
    """The torques of muscles in closed form at the measured pressures."""
    if x[X_OBSERVER] > 0.0:
        x[X_TORQUE_SEEN], _ = muscles_torques(c, table, w, W_LINE, W_AT_SEEN, x[X_INSIDE])
    if compares(s, x):
        place = x[X_LAGGING_INSIDE]
        x[X_TORQUE_LAGGING], x[X_GRIP] = muscles_torques(c, table, w, W_LINE, W_LAGGING, place)
    if s[S_ADAPTS] > 0.0:
        x[X_TORQUE_BEFORE], _ = muscles_torques(c, table, w, W_LINE, W_BEFORE, x[X_LAGGING_INSIDE])


def ask_ahead(c: Any, w: Any, x: Any, y: Any) -> None:
    """Torque and stiffness for the time when the last valve acts."""
    then = w[last_to_act(w)]
    x[X_ADDED] = x[X_KNOWN] - x[X_BASE] + y[Y_HANDED]
    x[X_ASKED_TORQUE] = needed_torque(c, then, W_ACTS) - x[X_ADDED]
    x[X_ASKED_STIFFNESS], x[X_ASKED_POSITION] = y[Y_STIFFNESS], then[W_ACTS + 1]


def plan_now(
    c: Any, j: Any, s: Any, w: Any, x: Any, y: Any, a: Any, plans: Any, ends: Any, step: float
) -> None:
    """What the pressures of now lack, and what is learnt from it."""
    now = x[X_NOW]
    last = w[last_to_act(w)][W_ACTS]
    remember(plans, ends, now, last, w, W_REACHED, y[Y_STIFFNESS], x[X_ADDED], x[X_KNOWN])
    for k in range(len(w)):
        muscle, field = w[k], P_PRESSURES + k
        shown = shown_pressure(plans, ends, muscle[W_SHOWN], now, j[J_LAG], step, field)
        muscle[W_SHOWN] = shown
        muscle[W_AHEAD] = planned_at(plans, ends, muscle[W_ACTS], field) - shown
        muscle[W_SHIFT] = shown - planned_at(plans, ends, now, field)
        muscle[W_RATE] = planned_rate(plans, ends, muscle[W_ACTS], field)
    x[X_PAST_STIFFNESS] = planned_at(plans, ends, now, P_STIFFNESS)
    memory = planned_at(plans, ends, now, P_MEMORY)
    torque = needed_torque(c, x, X_NOW) - memory + x[X_OUTPUT] + x[X_CORRECTION]
    torque += friction_change(c, x[X_SEEN + 2], x[X_VELOCITY])
    x[X_LOST] = math.nan
    if x[X_OBSERVER] > 0.0:
        x[X_LOST] = observed_loss(
            y, x[X_FRESH], x[X_TORQUE_SEEN] + memory,
            static_torque(c, x[X_POSITION], x[X_VELOCITY]), x[X_VELOCITY],
            moving_torque(c, 0.0, 1.0), moving_torque(c, 1.0, 0.0), j[J_LAG],
            x[X_OBSERVER], s[S_SPEED_FILTER], s[S_OBSERVER_LIMIT],
        )  # fmt: skip
        torque += x[X_LOST]
    x[X_PLANNED_TORQUE] = torque
    x[X_IS_DUE] = x[X_ESTIMATE_DUE] = 0.0
    x[X_UNEXPLAINED] = math.nan
    if not compares(s, x):
        return
    position, speed = y[Y_LAGGING], y[Y_LAGGING_SPEED]
    known = planned_at(plans, ends, x[X_SEEN], P_KNOWN)
    model = static_torque(c, position, speed)
    muscles = x[X_TORQUE_LAGGING]
    moves = muscles + known - model
    # what was learnt of the torque explains as well
    moving = muscles + planned_at(plans, ends, x[X_SEEN], P_MEMORY) - model
    x[X_EXPLAINED] = (moving - moving_torque(c, speed, 0.0)) / moving_torque(c, 0.0, 1.0)
    if s[S_ADAPTS] > 0.0:
        x[X_UNEXPLAINED] = moves
        is_due = take_torque(
            a, x[X_FRESH], moves, (muscles - x[X_TORQUE_BEFORE]) / RATE_SPAN,
            position, speed, s[S_SPEED_FILTER],
            planned_at(plans, ends, x[X_SEEN], P_STIFFNESS) + gravity_rate(c, position),
            x[X_GRIP],
        )  # fmt: skip
        x[X_BESIDE] = known - model + gravity(c, position)
        y[Y_SINCE_ESTIMATE] += max(x[X_FRESH], 0.0)
        x[X_IS_DUE] = 1.0 if is_due else 0.0
        x[X_ESTIMATE_DUE] = 1.0 if y[Y_SINCE_ESTIMATE] >= ESTIMATE_EVERY else 0.0


def aim_ahead(c: Any, s: Any, w: Any, x: Any, y: Any, a: Any) -> None:
    """Torque and stiffness for now, with the feedforward."""
    integral, disturbance = x[X_INTEGRAL], -x[X_LOST]
    if s[S_ADAPTS] > 0.0:
        # a motion that is repeated keeps what it was played with
        if x[X_BASE] == x[X_USUAL]:
            # by the feedforward, which is without the lag of the pressure loops: a change of the
            # integral itself would come later than that of what was learnt, and be a push
            then, most = w[last_to_act(w)], s[S_ADAPTATION_LIMIT]
            acts = learnt_torque(y, a, then, W_ACTS, most) - x[X_BASE] if x[X_IS_DUE] > 0.0 else 0.0
            before = y[Y_HANDED]
            y[Y_HANDED] = hand_over(integral - before, acts, before, most)
            keep_handed(y, y[Y_HANDED] - before)
        if a[A_KNOWS] > 0.0:  # so that a payload stays visible
            disturbance = (0.0 if math.isnan(disturbance) else disturbance) - x[X_BASE]
    friction = a[A_FRICTION] + dry_friction(c, 0.0)
    integral -= given_back(y, x, X_SEEN + 1, x[X_POSITION], integral, friction)
    y[Y_ADAPTED] = x[X_BASE]
    x[X_NEW_INTEGRAL], x[X_DISTURBANCE], x[X_HANDED] = integral, disturbance, y[Y_HANDED]
    x[X_ASKED_TORQUE], x[X_ASKED_STIFFNESS] = x[X_PLANNED_TORQUE], x[X_PAST_STIFFNESS]
    x[X_ASKED_POSITION] = x[X_NOW + 1]
    for k in range(len(w)):
        w[k][W_SPEED] = w[k][W_ACTS + 2]


def aim_at_output(w: Any, x: Any, y: Any) -> None:
    """Torque and stiffness for now, without a feedforward."""
    x[X_NEW_INTEGRAL], x[X_DISTURBANCE], x[X_HANDED] = x[X_INTEGRAL], math.nan, 0.0
    x[X_ASKED_TORQUE], x[X_ASKED_STIFFNESS] = x[X_OUTPUT], y[Y_STIFFNESS]
    x[X_ASKED_POSITION] = x[X_POSITION]
    for k in range(len(w)):
        w[k][W_RATE] = w[k][W_AHEAD] = w[k][W_SHIFT] = 0.0
        w[k][W_SPEED] = x[X_VELOCITY]


def planned(w: Any, x: Any, y: Any) -> None:
    """The plan, when the pressures are known."""
    for k in range(len(w)):
        # with what a lagging sensor adds, within what may be asked for
        w[k][W_REFERENCE] = limited(w[k][W_REACHED] + w[k][W_SHIFT], 0.0, w[k][W_MOST])
    missed = x[X_REACHED_TORQUE] - x[X_ASKED_TORQUE]
    x[X_MISSED] = missed if x[X_TORQUE_LIMITED] > 0.0 else 0.0
    x[X_TORQUE], x[X_STIFFNESS] = x[X_ASKED_TORQUE], y[Y_STIFFNESS]
    x[X_TRUE_STIFFNESS] = x[X_FACTOR] * x[X_REACHED_STIFFNESS]


def has_due(x: Any) -> bool:
    """Whether something of a joint is due to be learnt."""
    return bool(x[X_IS_DUE] > 0.0 or x[X_ESTIMATE_DUE] > 0.0)


def plan_joint(
    first: int, last: int, step: float, c: Any, j: Any, s: Any, w: Any, x: Any, y: Any, a: Any,
    memory: Any, plans: Any, plan_ends: Any, samples: Any, sample_ends: Any, table: Any,
) -> bool:  # fmt: skip
    """Go through parts of the plan for one joint; the rows are those of `plan_parts`.

    `table` are any rows. A joint of which something is due stops behind NOW; then True is returned.
    """
    ahead, closed, is_due = s[S_FEEDFORWARD] > 0.0, j[J_IN_CLOSED_FORM] > 0.0, False
    if first <= OBSERVE <= last:
        reach_stiffness = s[S_STIFFNESS_RATE] * step
        y[Y_STIFFNESS] += limited(x[X_WANTED] - y[Y_STIFFNESS], -reach_stiffness, reach_stiffness)
        if ahead:
            observe(c, j, s, w, x, y, a, memory, plans, plan_ends, samples, sample_ends)
            if closed:
                measured_torques(c, s, w, x, table)
    if first <= AHEAD <= last and ahead:
        ask_ahead(c, w, x, y)
        if closed:
            reach(c, j, w, x, table)
            place = inside(j, x[X_ASKED_POSITION])
            _, y[Y_GRIP] = muscles_torques(c, table, w, W_LINE, W_REACHED, place)
    if first <= NOW <= last and ahead:
        plan_now(c, j, s, w, x, y, a, plans, plan_ends, step)
        is_due = has_due(x)
    if is_due:
        return True
    if first <= AIM <= last:
        if ahead:
            aim_ahead(c, s, w, x, y, a)
        else:
            aim_at_output(w, x, y)
        if closed:
            reach(c, j, w, x, table)
    if first <= REACHED <= last:
        planned(w, x, y)
    return False


@entry_point
def plan_parts(
    first: int, last: int, begin: int, end: int, step: float, c: Any, j: Any, s: Any, w: Any,
    x: Any, y: Any, a: Any, memory: Any, plans: Any, plan_ends: Any, samples: Any, sample_ends: Any,
) -> bool:  # fmt: skip
    """Go through parts of the plan for joints.

    Parameters
    ----------
    first, last : int
        The parts, both included; but a joint of which something is due takes none behind NOW.
    begin, end : int
        The joints from `begin` to before `end`.
    step : float
        Time since the last cycle [s].
    c, j, s, w, x, y, a, memory, plans, plan_ends, samples, sample_ends : rows
        Of all joints: constants, numbers, settings, muscles, cycle, state, what is learnt, states
        of the muscles, what was planned and what was measured.

    Returns
    -------
    bool
        Whether something is due to be learnt of a joint.
    """
    is_due = False
    for i in range(begin, end):
        begins = first
        if first == RESUME and s[i][S_FEEDFORWARD] > 0.0 and has_due(x[i]):
            begins = AIM
        if plan_joint(
            begins, last, step, c[i], j[i], s[i], w[i], x[i], y[i], a[i], memory[i], plans[i],
            plan_ends[i], samples[i], sample_ends[i], c,
        ):  # fmt: skip
            is_due = True
    return is_due
