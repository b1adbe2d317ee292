"""The rows of numbers that the compiled plan of the model-based law works with, by joint."""

from __future__ import annotations

from typing import Final

N_MEMORY: Final = 7
"""Of `motion_functions`: the last position, four slip elements, two relaxed positions."""

# numbers: they stay the same
(J_POSITION_LOW, J_POSITION_HIGH, J_LOW_A, J_HIGH_A, J_LOW_B, J_HIGH_B, J_MOST_A, J_MOST_B, J_LAG,
 J_PRESLIDING, J_KEPT, J_IN_CLOSED_FORM, J_HAS_HISTORY) = range(13)  # fmt: skip
N_JOINT: Final = 13
"""Range of the muscles' models [rad]; ranges of the pressures, and the most that is asked for [Pa];
lag of the pressure sensors [s]; presliding of the dry friction [rad]; how long measured pressures
are kept [s]; whether both braids are in closed form; whether hysteresis, creep or friction act."""

# settings, which change with those of the controller
(S_FEEDFORWARD, S_STIFFNESS_RATE, S_ADAPTS, S_ADAPTATION_LIMIT, S_OBSERVER_LIMIT,
 S_SPEED_FILTER) = range(6)  # fmt: skip
N_SETTINGS: Final = 6

# input of a cycle, what one part of the plan leaves for the next one, and the plan
(X_OUTPUT, X_INTEGRAL, X_WANTED, X_FACTOR, X_POSITION, X_VELOCITY, X_FRESH, X_PRESSURE_A,
 X_PRESSURE_B, X_DESIRED_A, X_DESIRED_B, X_MEASURED_AT) = range(12)  # fmt: skip
X_SEEN, X_NOW, X_ACTS_A, X_ACTS_B = 12, 16, 20, 24
"""Each a time [s] and the reference at that time: position, velocity, acceleration."""
# fmt: off
(X_AT_SEEN_A, X_AT_SEEN_B, X_INSIDE, X_TORQUE_SEEN, X_LAGGING_A, X_LAGGING_B, X_BEFORE_A,
 X_BEFORE_B, X_LAGGING_INSIDE, X_TORQUE_LAGGING, X_TORQUE_BEFORE, X_KNOWN, X_USUAL, X_BASE,
 X_CORRECTION,
 X_ASKED_TORQUE, X_ASKED_STIFFNESS, X_ASKED_POSITION, X_REACHED_A, X_REACHED_B, X_REACHED_TORQUE,
 X_REACHED_STIFFNESS, X_TORQUE_LIMITED, X_STIFFNESS_LIMITED, X_ADDED, X_LOST, X_BESIDE, X_LEARNT,
 X_SHIFT_A, X_SHIFT_B, X_PLANNED_TORQUE, X_PAST_STIFFNESS, X_IS_DUE, X_ESTIMATE_DUE) = range(28, 62)
(X_REFERENCE_A, X_REFERENCE_B, X_RATE_A, X_RATE_B, X_AHEAD_A, X_AHEAD_B, X_SPEED_A, X_SPEED_B,
 X_MISSED, X_NEW_INTEGRAL, X_TORQUE, X_STIFFNESS, X_TRUE_STIFFNESS, X_DISTURBANCE) = range(62, 76)
X_OBSERVER, X_UNEXPLAINED = 76, 77
N_CYCLE: Final = 78

# state
(Y_STIFFNESS, Y_SHOWN_A, Y_SHOWN_B, Y_ADAPTED, Y_LAGGING, Y_LAGGING_SPEED, Y_HISTORY_POSITION,
 Y_HISTORY_TIME, Y_SLIP, Y_GATHERED, Y_PLACE, Y_TARGET, Y_STUCK_INTEGRAL, Y_LOST, Y_SMOOTH_LOST,
 Y_MUSCLES, Y_MOTION, Y_SPEED, Y_OBSERVED, Y_PLANNED_AT, Y_REFERENCE, Y_SINCE_ESTIMATE) = range(22)
# fmt: on
N_PLAN: Final = 22

# state and filters of what is learnt of the torque
N_SAMPLE: Final = 11
"""Unexplained torque, 1, q, q^3, the elements of `motion_functions`, rate of the torque."""
N_FUNCTIONS: Final = 12
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
N_LEARNING: Final = A_BEFORE + N_SAMPLE

# rows of a plan, and of a measured pair of pressures
P_TIME, P_A, P_B, P_STIFFNESS, P_MEMORY, P_KNOWN = range(6)
N_PLANNED: Final = 6
N_MEASURED: Final = 3
