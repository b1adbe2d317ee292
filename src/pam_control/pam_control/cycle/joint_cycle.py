"""What all laws share in one cycle of the joints: functions of rows, which `stages` compiles.

`sense` finds where the joints are and should be, and the output of the feedback; then the law plans
the pressures; `demand` says what the pressure loops have to do, and `settle` lets the integrals
follow what the valves could do.

The feedback compares a measurement with the reference at the time of that measurement. The
feedforward is computed for the time at which the valve will act.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pam_control.feedback.gain_schedule import gains_at
from pam_control.feedback.motion_observer import observe_motion
from pam_control.feedback.pid import (
    F_BEND,
    F_INTEGRAL,
    F_MOTION,
    F_PLANNED,
    F_SLOPE,
    G_MOTION,
    G_OBSERVER,
    N_FEEDBACK,
    N_GAINS,
    integrate,
    pid_output,
)
from pam_control.joint_models import JointModels
from pam_control.joint_setup import JointSetup
from pam_control.limited import limited
from pam_control.references.limited_references import reference_at
from pam_control.rows.loop_rows import (
    D_AHEAD,
    D_CUT,
    D_POSITION,
    D_PRESSURE,
    D_RATE,
    D_REFERENCE,
    D_SPEED,
    V_DELAY,
    V_TUBE,
)
from pam_control.rows.plan_rows import (
    N_CYCLE,
    N_MUSCLE,
    W_ACTS,
    W_AHEAD,
    W_DELAY,
    W_DESIRED,
    W_PRESSURE,
    W_RATE,
    W_REFERENCE,
    W_SPEED,
    X_DISTURBANCE,
    X_EXPLAINED,
    X_FRESH,
    X_HANDED,
    X_INTEGRAL,
    X_IS_OBSERVED,
    X_MEASURED_AT,
    X_MISSED,
    X_NEW_INTEGRAL,
    X_NOW,
    X_OBSERVER,
    X_OUTPUT,
    X_POSITION,
    X_REACHED_STIFFNESS,
    X_REACHED_TORQUE,
    X_SEEN,
    X_STIFFNESS,
    X_STIFFNESS_LIMITED,
    X_TORQUE,
    X_TORQUE_LIMITED,
    X_TRUE_STIFFNESS,
    X_UNEXPLAINED,
    X_VELOCITY,
)
from pam_control.rows.telemetry_rows import (
    Z_DISTURBANCE,
    Z_ERROR,
    Z_POSITION,
    Z_PRESSURES,
    Z_RATE_CUT,
    Z_REFERENCE,
    Z_SPEED,
    Z_STIFFNESS,
    Z_STIFFNESS_CUT,
    Z_STIFFNESS_REACHED,
    Z_TIME,
    Z_TORQUE,
    Z_TORQUE_CUT,
    Z_TORQUE_REACHED,
    Z_TRUE_STIFFNESS,
    Z_TUBES,
    Z_UNEXPLAINED,
    Z_VALVE_CUT,
    Z_YIELDS,
)
from pam_model.plant.compiled import for_kernel

(U_SPEED_FILTER, U_INTEGRAL_LIMIT, U_PRESSURE_RATE, U_POSITION_DELAY, U_PRESSURE_LAG,
 U_OFFSET, U_SCHEDULED) = range(7)  # fmt: skip
U_SCHEDULE: Final = 7
"""Settings of a joint: filter of the speed [s]; limit of the integral; largest rate of the desired
pressures [Pa/s]; delay of the position and lag of the pressures [s], and offset of the readings of
the position [rad], by the rig file; number of scheduled gains, which follow: the stiffness, and
`G_PROPORTIONAL` and its like."""
(K_POSITION, K_VELOCITY, K_TIME, K_STIFFNESS, K_DELAY, K_SEEN_POSITION, K_SEEN_ERROR,
 K_RATE_LIMITED, K_VALVE_LIMITED) = range(9)  # fmt: skip
K_GAINS: Final = 9
K_FEEDBACK: Final = K_GAINS + N_GAINS
N_STATE: Final = K_FEEDBACK + N_FEEDBACK
"""State of a joint: position [rad], filtered speed [rad/s] and time [s] of the last measurement;
stiffness by which gains are scheduled [N m/rad]; learnt delay of the position, negative if it is
that of the pressures [s]; measured position and error of this cycle [rad]; whether the rate of the
pressures, and a valve, was limited; gains; state of the feedback. Its desired pressures are
`plan_rows.W_DESIRED`."""


def take_position(k: Any, position: float, time: float, speed_filter: float) -> float:
    """Take a measured position [rad] of a time [s]; return the time since the last one, or 0."""
    if math.isnan(k[K_TIME]):
        k[K_POSITION], k[K_TIME] = position, time
        return 0.0
    step = time - k[K_TIME]
    if not step > 0.0:
        return 0.0
    weight = step / (speed_filter + step)
    k[K_VELOCITY] += weight * ((position - k[K_POSITION]) / step - k[K_VELOCITY])
    k[K_POSITION], k[K_TIME] = position, time
    return float(step)


def look_up(row: Any, at: int, time: float, history: Any, ends: Any, joint: int) -> None:
    """Write a time [s] and the reference at that time."""
    row[at] = time
    row[at + 1], row[at + 2], row[at + 3] = reference_at(history, ends, joint, time)


def copy_moment(row: Any, at: int, other: Any, other_at: int) -> None:
    """Write a moment that is the same as one of another row."""
    for place in range(4):
        row[at + place] = other[other_at + place]


def see_motion(k: Any, x: Any, position: float, fresh: float) -> None:
    """Let the derivatives of the error be those of the observed motion, where it is observed."""
    f, bandwidth = K_FEEDBACK, k[K_GAINS + G_MOTION]
    seen = f + F_MOTION
    x[X_IS_OBSERVED] = 1.0 if bandwidth > 0.0 else 0.0
    if bandwidth == 0.0:
        k[seen] = x[X_EXPLAINED] = math.nan
        return
    explained = x[X_EXPLAINED]
    observe_motion(k, seen, position, k[K_VELOCITY], explained, fresh, bandwidth)
    k[f + F_SLOPE] = x[X_SEEN + 2] - k[seen + 1]
    if fresh > 0.0:
        # both are the mean acceleration since the measurement before
        observed = 0.0 if math.isnan(explained) else explained + k[seen + 2]
        k[f + F_BEND] = 0.5 * (k[f + F_PLANNED] + x[X_SEEN + 3]) - observed
        k[f + F_PLANNED] = x[X_SEEN + 3]


def sense(
    owned: Any, w: Any, x: Any, k: Any, u: Any, d: Any, v: Any, history: Any, ends: Any,
    positions: Any, time: float, position_time: float, measured_at: float, measurement_delay: float,
) -> None:  # fmt: skip
    """Write the input of all plans: moments, measured motion, output of the feedback.

    Parameters
    ----------
    owned, w, x, k, u, d, v, history, ends : rows
        Muscles of joints (`muscle_table`) and their plan, cycle, state and settings of joints,
        demands and state of pressure loops, references.
    positions : (n,) array
        Readings of the sensors [rad].
    time, position_time, measured_at, measurement_delay : float
        Present time, stamp of the positions, when the pressures were measured, and age of a
        measurement at its stamp [s].
    """
    for i in range(len(x)):
        f, delay = K_FEEDBACK, k[i][K_DELAY]
        late = max(-delay, 0.0)
        now_at = measured_at - u[i][U_PRESSURE_LAG] - late
        seen_at = position_time - measurement_delay - u[i][U_POSITION_DELAY] - max(delay, 0.0)
        look_up(x[i], X_NOW, now_at, history, ends, i)
        if seen_at == now_at:
            copy_moment(x[i], X_SEEN, x[i], X_NOW)
        else:
            look_up(x[i], X_SEEN, seen_at, history, ends, i)
        for m in range(len(w[i])):
            loop, muscle = owned[i][m], w[i][m]
            muscle[W_PRESSURE] = d[loop][D_PRESSURE]
            acts = time + muscle[W_DELAY] + max(v[loop][V_DELAY] - late, 0.0)
            if m > 0 and acts == w[i][0][W_ACTS]:
                copy_moment(muscle, W_ACTS, w[i][0], W_ACTS)
            else:
                look_up(muscle, W_ACTS, acts, history, ends, i)
        position = positions[i] - u[i][U_OFFSET]
        fresh = take_position(k[i], position, position_time, u[i][U_SPEED_FILTER])
        error = x[i][X_SEEN + 1] - position
        gains_at(u[i], U_SCHEDULE, u[i][U_SCHEDULED], k[i][K_STIFFNESS], k[i], K_GAINS)
        see_motion(k[i], x[i], position, fresh)
        x[i][X_OUTPUT] = pid_output(k[i], f, K_GAINS, error, fresh)
        x[i][X_INTEGRAL] = k[i][f + F_INTEGRAL]
        x[i][X_OBSERVER] = k[i][K_GAINS + G_OBSERVER]
        x[i][X_POSITION], x[i][X_VELOCITY] = k[i][K_POSITION], k[i][K_VELOCITY]
        x[i][X_FRESH], x[i][X_MEASURED_AT] = fresh, measured_at
        k[i][K_SEEN_POSITION], k[i][K_SEEN_ERROR] = position, error


def demand(owned: Any, w: Any, x: Any, k: Any, u: Any, d: Any, step: float) -> None:
    """Write what the pressure loops have to do for the plans of all joints."""
    for i in range(len(x)):
        k[i][K_FEEDBACK + F_INTEGRAL] = x[i][X_NEW_INTEGRAL]
        reach = u[i][U_PRESSURE_RATE] * step
        is_limited = False
        for m in range(len(w[i])):
            muscle, row = w[i][m], d[owned[i][m]]
            wanted, before = muscle[W_REFERENCE], muscle[W_DESIRED]
            desired = limited(wanted, before - reach, before + reach)
            is_limited = is_limited or desired != wanted
            muscle[W_DESIRED] = row[D_REFERENCE] = desired
            row[D_RATE], row[D_AHEAD] = muscle[W_RATE], muscle[W_AHEAD]
            moved = muscle[W_ACTS + 1] - x[i][X_SEEN + 1]
            row[D_POSITION], row[D_SPEED] = k[i][K_SEEN_POSITION] + moved, muscle[W_SPEED]
        k[i][K_RATE_LIMITED] = 1.0 if is_limited else 0.0


def settle(
    owned: Any, w: Any, x: Any, k: Any, u: Any, v: Any, d: Any, z: Any, step: float, sinks: bool
) -> None:
    """Advance the integrals of all joints after their valves were commanded; write the telemetry.

    `sinks`: the air is let out slowly.
    """
    for i in range(len(x)):
        is_cut, tubes = False, 0.0
        for m in range(len(owned[i])):
            is_cut = is_cut or d[owned[i][m]][D_CUT] > 0.0
            tubes += 1.0 if v[owned[i][m]][V_TUBE] > 0.0 else 0.0
            z[i][Z_PRESSURES + m] = w[i][m][W_DESIRED]
        k[i][K_VALVE_LIMITED] = 1.0 if is_cut else 0.0
        # a stiffness out of reach costs no torque, so that the integrator may go on
        saturated = is_cut or k[i][K_RATE_LIMITED] > 0.0 or x[i][X_TORQUE_LIMITED] > 0.0
        integrate(
            k[i], K_FEEDBACK, K_GAINS, k[i][K_SEEN_ERROR], step, x[i][X_MISSED],
            u[i][U_INTEGRAL_LIMIT], sinks or (x[i][X_MISSED] == 0.0 and saturated),
            x[i][X_HANDED],
        )  # fmt: skip
        show(x[i], k[i], z[i], sinks)
        z[i][Z_TUBES] = tubes


def show(x: Any, k: Any, z: Any, sinks: bool) -> None:
    """Write the telemetry of a joint, but for that of its muscles."""
    for place in range(3):
        z[Z_REFERENCE + place] = x[X_SEEN + 1 + place]
    z[Z_POSITION], z[Z_SPEED], z[Z_TIME] = k[K_POSITION], k[K_VELOCITY], k[K_TIME]
    z[Z_ERROR] = k[K_SEEN_ERROR]
    z[Z_TORQUE], z[Z_STIFFNESS] = x[X_TORQUE], x[X_STIFFNESS]
    z[Z_TORQUE_REACHED], z[Z_STIFFNESS_REACHED] = x[X_REACHED_TORQUE], x[X_REACHED_STIFFNESS]
    z[Z_TRUE_STIFFNESS], z[Z_DISTURBANCE] = x[X_TRUE_STIFFNESS], x[X_DISTURBANCE]
    z[Z_UNEXPLAINED] = math.nan if sinks else x[X_UNEXPLAINED]
    z[Z_TORQUE_CUT] = x[X_TORQUE_LIMITED]
    z[Z_STIFFNESS_CUT] = 0.0 if sinks else x[X_STIFFNESS_LIMITED]
    z[Z_RATE_CUT], z[Z_VALVE_CUT] = k[K_RATE_LIMITED], k[K_VALVE_LIMITED]


def longest_delay(owned: Any, k: Any, v: Any) -> float:
    """Longest learnt delay of a command, in addition to the stated ones [s]."""
    longest = 0.0
    for i in range(len(k)):
        late = max(-k[i][K_DELAY], 0.0)
        for m in range(len(owned[i])):
            longest = max(longest, v[owned[i][m]][V_DELAY] - late)
    return longest


def new_cycle(joints: int, muscles: int) -> tuple[Any, Any]:
    """Rows of the muscles of joints, and of a cycle, for a law that has none of its own."""
    rows = np.zeros((joints, muscles, N_MUSCLE)), np.zeros((joints, N_CYCLE))
    return for_kernel(rows[0]), for_kernel(rows[1])


class CycleRows:
    """The rows of all joints.

    Parameters
    ----------
    w, x : rows
        Of the muscles of each joint, and of the cycle (`plan_rows`).

    Attributes
    ----------
    w, x, k, u, z
        Muscles, cycle, state, settings and telemetry of the joints.
    """

    def __init__(self, w: Any, x: Any) -> None:
        self.w, self.x = w, x
        self.k = for_kernel(np.zeros((len(x), N_STATE)))
        self.u = for_kernel(np.zeros((len(x), U_SCHEDULE)))
        z = np.full((len(x), Z_PRESSURES + len(w[0])), math.nan)
        z[:, Z_YIELDS : Z_TUBES + 1] = 0.0
        self.z = for_kernel(z)

    def use(self, setups: Sequence[JointSetup], joints: Sequence[JointModels]) -> None:
        """Use other settings from the next cycle on."""
        rows = []
        for muscles, setup, models in zip(self.w, setups, joints, strict=True):
            schedule = setup.gains.row
            for muscle, delay in zip(muscles, setup.acting_delays, strict=True):
                muscle[W_DELAY] = delay
            rows.append(
                [
                    setup.settings.derivative_filter, setup.integral_limit,
                    setup.settings.pressure_rate, models.position_delay, models.pressure_lag,
                    models.joint.position_offset,
                    len(setup.gains.stiffnesses), *schedule,
                ]
            )  # fmt: skip
        width = max(map(len, rows))
        self.u = for_kernel(np.array([row + [0.0] * (width - len(row)) for row in rows]))
