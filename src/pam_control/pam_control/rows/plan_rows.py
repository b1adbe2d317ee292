"""The rows of numbers that the compiled plan of the model-based law works with, by joint."""

from __future__ import annotations

from typing import Final

from pam_model.joints.muscle_inverse import N_LINE

N_MEMORY: Final = 7
"""Of `motion_functions`: the last position, four slip elements, two relaxed positions."""

# numbers of a joint: they stay the same
(J_POSITION_LOW, J_POSITION_HIGH, J_LAG, J_PRESLIDING, J_KEPT, J_IN_CLOSED_FORM,
 J_HAS_HISTORY) = range(7)  # fmt: skip
N_JOINT: Final = 7
"""Range of the muscles' models [rad]; lag of the pressure sensors [s]; presliding of the dry
friction [rad]; how long measured pressures are kept [s]; whether all braids are in closed form;
whether hysteresis, creep or friction act."""

# numbers of each muscle of a joint, a setting, input of a cycle, what one part of the plan leaves
# for the next one, and the plan
W_LOW, W_HIGH, W_MOST, W_DELAY, W_PRESSURE, W_DESIRED = range(6)
W_ACTS: Final = 6
"""A time [s], when the valve acts, and the reference at that time, as `X_SEEN`."""
(W_AT_SEEN, W_LAGGING, W_BEFORE, W_PLANNED, W_REACHED, W_SHOWN, W_SHIFT, W_REFERENCE, W_RATE,
 W_AHEAD, W_SPEED) = range(10, 21)  # fmt: skip
W_LINE: Final = 21
"""What the inverse needs of the muscle, with its arm over the radius (`muscle_inverse.L_*`)."""
N_MUSCLE: Final = W_LINE + N_LINE
"""Range of the pressure, and the most that is asked for [Pa]; time until the valve acts by the rig
file [s]; measured and desired pressure [Pa]."""

# settings, which change with those of the controller
(S_FEEDFORWARD, S_STIFFNESS_RATE, S_ADAPTS, S_ADAPTATION_LIMIT, S_OBSERVER_LIMIT,
 S_SPEED_FILTER) = range(6)  # fmt: skip
N_SETTINGS: Final = 6

# input of a cycle, what one part of the plan leaves for the next one, and the plan
(X_OUTPUT, X_INTEGRAL, X_WANTED, X_FACTOR, X_POSITION, X_VELOCITY, X_FRESH,
 X_MEASURED_AT) = range(8)  # fmt: skip
X_SEEN, X_NOW = 8, 12
"""Each a time [s] and the reference at that time: position, velocity, acceleration."""
# fmt: off
(X_INSIDE, X_TORQUE_SEEN, X_LAGGING_INSIDE, X_TORQUE_LAGGING, X_TORQUE_BEFORE, X_KNOWN, X_USUAL,
 X_BASE, X_CORRECTION, X_ASKED_TORQUE, X_ASKED_STIFFNESS, X_ASKED_POSITION, X_REACHED_TORQUE,
 X_REACHED_STIFFNESS, X_TORQUE_LIMITED, X_STIFFNESS_LIMITED, X_ADDED, X_LOST, X_BESIDE,
 X_PLANNED_TORQUE, X_PAST_STIFFNESS, X_IS_DUE, X_ESTIMATE_DUE, X_MISSED, X_NEW_INTEGRAL, X_TORQUE,
 X_STIFFNESS, X_TRUE_STIFFNESS, X_DISTURBANCE, X_OBSERVER, X_UNEXPLAINED, X_HANDED,
 X_GRIP, X_IS_OBSERVED, X_EXPLAINED) = range(16, 51)
N_CYCLE: Final = 51
"""`X_HANDED`: `Y_HANDED`, for the integral. `X_IS_OBSERVED`: whether `motion_observer` acts.
`X_EXPLAINED`: the acceleration that the model finds, for the next cycle [rad/s^2]."""

# state
(Y_STIFFNESS, Y_ADAPTED, Y_LAGGING, Y_LAGGING_SPEED, Y_HISTORY_POSITION,
 Y_HISTORY_TIME, Y_SLIP, Y_GATHERED, Y_PLACE, Y_TARGET, Y_STUCK_INTEGRAL, Y_LOST, Y_SMOOTH_LOST,
 Y_MUSCLES, Y_MOTION, Y_SPEED, Y_OBSERVED, Y_PLANNED_AT, Y_REFERENCE, Y_SINCE_ESTIMATE,
 Y_HANDED, Y_ZERO, Y_GRIP) = range(23)
# fmt: on
N_PLAN: Final = 23
"""`Y_HANDED`: what the feedforward takes off the integral, which goes on with it [N m].
`Y_ZERO` [N m/rad], `Y_GRIP` [N m]: what a false zero of the position and a false gain of a pressure
act with by the plan (`torque_adaptation`)."""

# state and filters of what is learnt of the torque
N_SAMPLE: Final = 13
"""Unexplained torque, 1, q, q^3, the elements of `motion_functions`, rate of the torque, and what a
zero of the position and a gain of a pressure act with (`torque_adaptation`)."""
N_FUNCTIONS: Final = 14
(A_BEGUN, A_SINCE, A_DELAY, A_WANTED_DELAY, A_KNOWS, A_FRICTION, A_SPEED_ONCE, A_SPEED_TWICE,
 A_SPEED_BEFORE) = range(9)  # fmt: skip
A_WEIGHTS: Final = 9
A_PLANNED: Final = A_WEIGHTS + N_FUNCTIONS
A_MEASURED: Final = A_PLANNED + N_MEMORY
A_RAW: Final = A_MEASURED + N_MEMORY
A_SMOOTH: Final = A_RAW + N_SAMPLE
A_ONCE: Final = A_SMOOTH + N_SAMPLE
A_TWICE: Final = A_ONCE + N_SAMPLE
A_BEFORE: Final = A_TWICE + N_SAMPLE
A_WAITS: Final = A_BEFORE + N_SAMPLE
A_TAKEN_OVER: Final = A_WAITS + 1
A_STOOD: Final = A_WAITS + 2
A_REST: Final = A_WAITS + 3
N_LEARNING: Final = A_REST + N_FUNCTIONS + 1
"""Last, of a joint that was taken over: whether it waits for its reference to move, from where
[rad]; whether it has stood there, and the functions and the torque of that time."""

# rows of a plan, and of measured pressures: the numbers before those of the muscles
P_TIME, P_STIFFNESS, P_MEMORY, P_KNOWN, P_PRESSURES = range(5)
P_MEASURED: Final = 1
