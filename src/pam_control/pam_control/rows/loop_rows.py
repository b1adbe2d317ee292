"""The rows of numbers that the compiled pressure loops of all muscles work with.

One row for each muscle, in the order of `muscle_table`.
"""

from __future__ import annotations

from typing import Final

# numbers: they stay the same
(N_FULL, N_PER_PRESSURE, N_PER_SQUARE, N_THRESHOLD, N_LAG, N_SHORTEST, N_LONGEST, N_CONDUCTANCE,
 N_CRITICAL, N_REGULATED, N_MOST, N_IN_CLOSED_FORM, N_SIGN, N_GAIN,
 N_BIAS) = range(15)  # fmt: skip
N_NUMBERS: Final = 15
"""Flow of the open valve from the supply [kg/s]; the same per pressure of the supply [kg/(s Pa)];
loss of a tube per square of the flow, see `TubeSearch`; least half wave that counts [Pa]; lag of
the valve [s]; range of the force model's lengths [m]; conductance [m^3/(s Pa)] and critical ratio
[-] of the valve; whether it is a pressure regulator, and its largest command
[Pa]; whether the gas volume follows from the joint's numbers; sign of its torque; gain [-] and bias
[Pa] of the sensor's reading by the rig file."""

# settings of a joint: they change with the settings of the controller
G_GAIN, G_LEAD_RATIO, G_SPOOL_LIMIT, G_ADAPTS, G_ACTS = range(5)
N_SETTINGS: Final = 5
"""Gain [1/s]; part of the valve's lag that is left [-]; largest spool command [-]; whether to learn
how the valve's flow differs from its data; time from a measurement until a command acts, but for
the age of the measurement [s]."""

# state
(V_FACTOR, V_SLOW, V_SIGN, V_PEAK, V_BEFORE, V_LASTED, V_COUNT, V_LAGGED, V_INSIDE, V_FLOW, V_RATE,
 V_SHOWN, V_LOSS, V_LATE, V_MOVED, V_TAKEN, V_WARM, V_SINCE, V_BEGUN, V_TRUE, V_PER_RATE, V_DELAY,
 V_FOUND_DELAY, V_TUBE, V_CHATTERED, V_WEIGHTS) = range(26)  # fmt: skip
N_WEIGHTS: Final = 9
V_SMOOTH: Final = V_WEIGHTS + N_WEIGHTS
N_SMOOTH: Final = 11
N_STATE: Final = V_SMOOTH + N_SMOOTH
"""Of `pressure_watch`: the factor on the gain to the count; of `valve_lead`: the lagged opening; of
`tube_pressure` and its flow: pressure inside to the loss; of `flow_adaptation`: the rest."""

# demand of a cycle
(D_REFERENCE, D_RATE, D_AHEAD, D_POSITION, D_SPEED, D_PRESSURE, D_VOLUME, D_BY_LENGTH,
 D_BY_PRESSURE, D_CUT) = range(10)  # fmt: skip
N_DEMAND: Final = 10
"""Desired pressure at the time of measurement [Pa]; feedforward of its rate for the time when the
valve will act [Pa/s], and its change until then [Pa]; position [rad] and speed [rad/s] of the joint
at that time; pressure in the muscle [Pa]; gas volume [m^3] and its derivatives
by length [m^2] and pressure [m^3/Pa], for a muscle that is not in closed form; whether
its valve was limited."""
