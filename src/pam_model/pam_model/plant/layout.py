"""The layout of the plant's arrays: parameters by name, derived constants, states, outputs.

The compiled kernels index flat arrays with these integers; all other code uses names. A joint has
its own entries first, then those of each of its muscles, of which there may be any number. The
entries of effects (constants of their laws, states of PullState) follow those of the ideal rig, in
the order of the registry.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pam_model.effects.declaration import Effect
from pam_model.effects.registry import EFFECTS, filled
from pam_model.effects.slots import Adjusts, PullState

# --- parameters of the rig file, by name and unit ---------------------------------------------
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
    ("valve.damping", "-"),  # of a regulator's two poles
)

# --- derived constants of the joint, then of each muscle (see `constants_at`) -------------------
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
    C_DRAWN,
    C_LOWER,
    C_UPPER,
    C_RT,
    C_DENSITY,
    C_DROOP,
    C_DROOP_VOLUME,
    C_DROOP_CONDUCTANCE,
    C_DROOP_CRITICAL,
    C_FRICTION,
    C_PRESLIDING,
    C_RATE,
    C_PER_INERTIA,
    C_ARM_SLOPE,
    C_ARM_BEND,
) = range(25)
(
    M_ARM,
    M_CROSSED,
    M_CROSSED_SPEED,
    M_TABLE,
    M_B,
    M_PER_B,
    M_SCALE,
    M_WALL,
    M_D90,
    M_REST,
    M_NEUTRAL,
    M_DEAD,
    M_FACTOR,
    M_THRESHOLD,
    M_SHORTEST,
    M_LONGEST,
    M_TABLE_STEP,
    M_REGULATOR,
    M_CONDUCTANCE,
    M_EXHAUST,
    M_CRITICAL,
    M_PER_LAG,
    M_SWING,
    M_TUBE,
    M_TUBE_VOLUME,
    M_TUBE_CONDUCTANCE,
    M_DELAY,
    M_CABLE,
    M_BRAID_AREA,
    M_BRAID_SLOPE,
    M_THERMAL,
    M_SHUT_EXPONENT,
    M_THREAD,
) = range(33)


@dataclass(frozen=True, slots=True)
class EffectConstants:
    """Indices of an effect's numbers in the constants of the joint or of each muscle."""

    effect: Effect  # an effect whose law the kernels call
    is_on: int  # index of the switch: 1 if a magnitude is not neutral, else 0
    parameters: Mapping[str, int]  # index of each parameter


def _effect_constants(of_muscle: bool, first: int) -> tuple[dict[str, EffectConstants], int]:
    """Indices of all effects with a compiled law, beginning at `first`, and the next free index."""
    found: dict[str, EffectConstants] = {}
    for effect in EFFECTS.values():
        called = any(not isinstance(slot, Adjusts) for slot in effect.slots)
        if called and (effect.scope == "muscle") == of_muscle:
            places = {key: first + 1 + i for i, key in enumerate(effect.parameters)}
            found[effect.name] = EffectConstants(effect, first, places)
            first += 1 + len(places)
    return found, first


JOINT_EFFECTS, C_MUSCLES = _effect_constants(False, C_ARM_BEND + 1)
MUSCLE_EFFECTS, N_MUSCLE_CONSTANTS = _effect_constants(True, M_THREAD + 1)

# --- states ------------------------------------------------------------------------------------
Y_POSITION, Y_VELOCITY, Y_RESERVOIR, Y_BRISTLE = range(4)
Y_MUSCLES = 4
S_SPOOL, S_PRESSURE, S_VALVE_PRESSURE, S_TEMPERATURE = range(4)
PULL_STATES: Mapping[str, int] = {
    slot.name: S_TEMPERATURE + 1 + i for i, (_, slot) in enumerate(filled(PullState))
}
"""The states that effects add to each muscle: name -> index."""
N_MUSCLE_STATES = S_TEMPERATURE + 1 + len(PULL_STATES)

# --- outputs -----------------------------------------------------------------------------------
O_POSITION, O_VELOCITY, O_TORQUE, O_RESERVOIR = range(4)
O_MUSCLES = 4
O_PRESSURE, O_VALVE_PRESSURE, O_FORCE, O_LENGTH, O_SPOOL, O_TEMPERATURE = range(6)
N_MUSCLE_OUTPUTS = 6


# --- a joint with any number of muscles: what it has, then what each of its muscles has ----------
def constants_of(muscle: int) -> int:
    """Where the constants of a muscle begin; of one beyond the last, the number of constants."""
    return C_MUSCLES + muscle * N_MUSCLE_CONSTANTS


def states_of(muscle: int) -> int:
    """Where the states of a muscle begin; of one beyond the last, the number of states."""
    return Y_MUSCLES + muscle * N_MUSCLE_STATES


def outputs_of(muscle: int) -> int:
    """Where the outputs of a muscle begin; of one beyond the last, the number of outputs."""
    return O_MUSCLES + muscle * N_MUSCLE_OUTPUTS


def output_names(muscles: Iterable[str]) -> tuple[str, ...]:
    """Names of the outputs of a joint with these muscles."""
    of_joint = ("position", "velocity", "torque", "reservoir_pressure")
    of_muscle = ("pressure", "valve_pressure", "force", "length", "spool", "temperature")
    return (*of_joint, *(f"{muscle}.{output}" for muscle in muscles for output in of_muscle))
