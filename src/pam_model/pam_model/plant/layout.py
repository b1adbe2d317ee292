"""Where each number of the plant lies: parameters by name, derived constants, states, outputs.

The compiled kernels index flat arrays with these integers; everything else goes by name.
"""

from __future__ import annotations

MUSCLES = ("agonist", "antagonist")

# --- parameters: what a rig file and its effects say, by name and unit ------------------------
JOINT_NOMINAL = (
    ("gas.temperature", "K"),
    ("gas.ambient_pressure", "Pa"),
    ("gas.polytropic_exponent", "-"),
    ("supply_pressure", "Pa"),
    ("joint.pulley_radius", "m"),
    ("joint.inertia", "kg m^2"),
    ("joint.viscous_friction", "N m s/rad"),
    ("joint.gravity_torque", "N m"),
    ("joint.gravity_angle", "rad"),
    ("joint.lower_limit", "rad"),
    ("joint.upper_limit", "rad"),
)
MUSCLE_NOMINAL = (
    ("model_kind", "-"),  # 0 closed form, 1 table
    ("thread_length", "m"),
    ("turns", "-"),
    ("wall_thickness", "m"),
    ("rest_length", "m"),
    ("neutral_length", "m"),
    ("dead_volume", "m^3"),
    ("contraction_factor", "-"),  # Tondu and Lopez's k, 1 for a cylinder
    ("shortest_length", "m"),
    ("longest_length", "m"),
    ("table_pressure_step", "Pa"),
    ("valve.kind", "-"),  # 0 flow, 1 pressure regulator
    ("valve.sonic_conductance", "m^3/(s Pa)"),
    ("valve.critical_ratio", "-"),
    ("valve.time_constant", "s"),
)

# --- derived constants of the joint, then of each muscle (offset by AGONIST, ANTAGONIST) -------
(
    C_TEMPERATURE,
    C_AMBIENT,
    C_EXPONENT,
    C_SUPPLY,
    C_RADIUS,
    C_INERTIA,
    C_VISCOUS,
    C_GRAVITY,
    C_GRAVITY_ANGLE,
    C_EXTERNAL,
    C_LOWER,
    C_UPPER,
    C_RT,
    C_DENSITY,
    C_DROOP,
    C_DROOP_VOLUME,
    C_DROOP_CONDUCTANCE,
    C_COULOMB,
    C_STRIBECK,
    C_STRIBECK_SPEED,
    C_PRESLIDING,
    C_RATE,
) = range(22)
AGONIST = 22
(
    M_TABLE,
    M_B,
    M_SCALE,
    M_WALL,
    M_D90,
    M_REST,
    M_NEUTRAL,
    M_DEAD,
    M_FACTOR,
    M_SHORTEST,
    M_LONGEST,
    M_TABLE_STEP,
    M_REGULATOR,
    M_CONDUCTANCE,
    M_CRITICAL,
    M_LAG,
    M_OVERLAP,
    M_NULL,
    M_EXHAUST,
    M_TUBE,
    M_TUBE_VOLUME,
    M_TUBE_CONDUCTANCE,
    M_DELAY,
    M_LEAK,
    M_THERMAL,
    M_HYSTERESIS,
    M_PRESLIDING,
    M_CREEP,
    M_CREEP_TIME,
    M_ELASTIC,
    M_CUBIC,
    M_THREAD,
    M_CABLE,
) = range(33)
N_MUSCLE_CONSTANTS = 33
ANTAGONIST = AGONIST + N_MUSCLE_CONSTANTS
N_CONSTANTS = AGONIST + 2 * N_MUSCLE_CONSTANTS

# --- states ------------------------------------------------------------------------------------
Y_POSITION, Y_VELOCITY, Y_RESERVOIR, Y_BRISTLE = 0, 1, 2, 3
Y_AGONIST = 4
S_SPOOL, S_PRESSURE, S_VALVE_PRESSURE, S_TEMPERATURE, S_CREEP, S_HYSTERESIS = range(6)
N_MUSCLE_STATES = 6
Y_ANTAGONIST = Y_AGONIST + N_MUSCLE_STATES
N_STATES = Y_AGONIST + 2 * N_MUSCLE_STATES
STATE_NAMES = (
    "position",
    "velocity",
    "reservoir_pressure",
    "friction_bristle",
    *(
        f"{muscle}.{state}"
        for muscle in MUSCLES
        for state in (
            "spool",
            "pressure",
            "valve_pressure",
            "temperature",
            "creep",
            "hysteresis",
        )
    ),
)

# --- outputs -----------------------------------------------------------------------------------
OUTPUT_NAMES = (
    "position",
    "velocity",
    "torque",
    "reservoir_pressure",
    *(
        f"{muscle}.{output}"
        for muscle in MUSCLES
        for output in ("pressure", "valve_pressure", "force", "length", "spool", "temperature")
    ),
)
N_OUTPUTS = len(OUTPUT_NAMES)
N_JOINT_OUTPUTS, N_MUSCLE_OUTPUTS = 4, 6
