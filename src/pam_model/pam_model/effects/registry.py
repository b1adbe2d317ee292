"""What an ideal rig leaves out: the effects by name, with their parameters.

A rig file names them under `<muscle>.effects.<effect>.<parameter>`,
`<joint>.effects.<effect>.<parameter>` or, for what the whole rig shares,
`effects.<effect>.<parameter>`. Simulation applies them, diagnosis fits them. A parameter at its
`neutral` value adds nothing. Some parameters only shape an effect that another one switches on
(a time constant, a volume): their neutral value is what applies when a rig file leaves them out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Stage = Literal["valve", "muscle", "joint", "sensing"]
Scope = Literal["muscle", "joint", "rig"]
EffectValues = Mapping[str, Mapping[str, float]]
"""Effect name -> parameter name -> value, as a muscle, a joint or a rig carries it."""


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """One number of an effect.

    Attributes
    ----------
    symbol : str
        As formulas write it.
    unit : str
        SI.
    neutral : float
        What applies when a rig file leaves it out; for a magnitude, the value that adds nothing.
    low, high : float
        What a rig file may say and a fit may try.
    description : str
        One line.
    is_shape : bool
        It shapes an effect that another parameter switches on; alone it adds nothing.
    """

    symbol: str
    unit: str
    neutral: float
    low: float
    high: float
    description: str
    is_shape: bool = False


@dataclass(frozen=True, slots=True)
class Effect:
    """One thing an ideal rig leaves out.

    Attributes
    ----------
    name : str
        Identifier used by rig files, reports and diagnoses.
    stage : str
        Where between command and measurement it acts.
    scope : str
        Whether each muscle, each joint or the whole rig has its own parameters.
    description : str
        One line.
    law : str
        What is computed, in the symbols of the parameters.
    source : str
        Where the law is from.
    parameters : mapping of str to EffectParameter
        By the name a rig file uses.
    """

    name: str
    stage: Stage
    scope: Scope
    description: str
    law: str
    source: str
    parameters: Mapping[str, EffectParameter]

    @property
    def magnitudes(self) -> tuple[str, ...]:
        """The parameters that switch the effect off when all are at their neutral values."""
        return tuple(key for key, entry in self.parameters.items() if not entry.is_shape)

    def is_neutral(self, values: Mapping[str, float]) -> bool:
        """Whether these values add nothing."""
        return all(
            values.get(key, self.parameters[key].neutral) == self.parameters[key].neutral
            for key in self.magnitudes
        )


_P = EffectParameter
_ISO = "ISO 6358-1, flow-rate characteristics of pneumatic components"
_WORK = "virtual work on the nominal braid"

_TABLE = (
    Effect(
        "valve_dead_zone",
        "valve",
        "muscle",
        "spool overlap: no flow while the spool is inside it, full opening still at 1",
        "x_open = sign(x) max(0, (|x| - x_o)/(1 - x_o))",
        "spool valve with overlap",
        {"overlap": _P("x_o", "-", 0.0, 0.0, 0.5, "spool travel without flow, each way")},
    ),
    Effect(
        "valve_null_offset",
        "valve",
        "muscle",
        "the closed position is not at zero",
        "x_open = x + x_n, cut to [-1, 1]",
        "spool valve",
        {"offset": _P("x_n", "-", 0.0, -0.3, 0.3, "opening at zero command")},
    ),
    Effect(
        "valve_lag",
        "valve",
        "muscle",
        "the spool is slower than written",
        "dx/dt = (u - x)/(time_constant + tau_x)",
        "first-order spool",
        {"extra_time_constant": _P("tau_x", "s", 0.0, 0.0, 0.2, "added to valve.time_constant")},
    ),
    Effect(
        "exhaust_restriction",
        "valve",
        "muscle",
        "the exhaust path lets less air through than the supply path",
        "C = ratio * sonic_conductance while x < 0",
        _ISO,
        {"ratio": _P("C_e/C_s", "-", 1.0, 0.05, 2.0, "exhaust over supply conductance")},
    ),
    Effect(
        "supply_droop",
        "valve",
        "rig",
        "the valves draw from a reservoir that supply_pressure refills through a restriction",
        "dP_s/dt = k R T (mdot_in - sum of mdot_drawn)/V_s, mdot_in by ISO 6358 with C_s",
        _ISO,
        {
            "conductance": _P("C_s", "m^3/(s Pa)", 0.0, 0.0, 1e-6, "refill path; 0: no droop"),
            "volume": _P("V_s", "m^3", 1e-3, 1e-6, 1.0, "reservoir", True),
        },
    ),
    Effect(
        "tube_restriction",
        "valve",
        "muscle",
        "a tube lies between the valve, where the sensor is, and the muscle",
        "two chambers: valve -> V_t, then ISO 6358 with C_t -> muscle",
        _ISO,
        {
            "conductance": _P("C_t", "m^3/(s Pa)", 0.0, 0.0, 1e-6, "of the tube; 0: no tube"),
            "volume": _P("V_t", "m^3", 1e-5, 1e-8, 1e-2, "gas in the tube", True),
        },
    ),
    Effect(
        "command_delay",
        "valve",
        "muscle",
        "pure transport delay before the valve",
        "u(t) = u_commanded(t - t_d)",
        "transport delay",
        {"delay": _P("t_d", "s", 0.0, 0.0, 0.2, "dead time")},
    ),
    Effect(
        "leakage",
        "valve",
        "muscle",
        "air leaves the muscle to ambient",
        "mdot = ISO 6358 with C_l from muscle to ambient, always open",
        _ISO,
        {"conductance": _P("C_l", "m^3/(s Pa)", 0.0, 0.0, 1e-8, "of the leak")},
    ),
    Effect(
        "dead_volume",
        "valve",
        "muscle",
        "more gas volume than written",
        "V = V_braid + dead_volume + V_x",
        "geometry",
        {"extra_volume": _P("V_x", "m^3", 0.0, -1e-4, 1e-2, "added to dead_volume")},
    ),
    Effect(
        "thermal",
        "valve",
        "muscle",
        "the gas heats and cools: first law with heat transfer to the wall at gas.temperature",
        "dT/dt from the first law, Q = G (T_wall - T); replaces the polytropic chamber while G > 0",
        "first law of an open chamber of ideal gas",
        {
            "conductance": _P(
                "G",
                "W/K",
                0.0,
                0.0,
                1e3,
                "gas to wall; exactly 0 keeps the nominal polytropic chamber, a small value "
                "(1e-6) is adiabatic, a large one isothermal",
            )
        },
    ),
    Effect(
        "hysteresis",
        "muscle",
        "muscle",
        "rate-independent thread friction that grows with pressure",
        "F = F_static + h p b^2/(4 pi n^2) z, |z| <= 1, z rising by dL/s_p until it slips",
        "Coulomb friction with presliding (Dahl's first-order form)",
        {
            "amplitude": _P("h", "-", 0.0, 0.0, 0.5, "saturated friction over p b^2/(4 pi n^2)"),
            "presliding_length": _P("s_p", "m", 5e-4, 1e-6, 2e-2, "stroke to build it up", True),
        },
    ),
    Effect(
        "creep",
        "muscle",
        "muscle",
        "viscoelastic bladder: it resists a change of length and gives way in seconds to minutes",
        "F = F_static + c K_3 (L - L_c), dL_c/dt = (L - L_c)/tau_c, K_3 = dF/dL of the braid at "
        "3 bar and its rest length",
        "Maxwell element beside the bladder's own spring (standard linear solid)",
        {
            "ratio": _P("c", "-", 0.0, 0.0, 0.5, "stiffness that relaxes away, over K_3"),
            "time_constant": _P("tau_c", "s", 10.0, 0.1, 1e3, "of the relaxation", True),
        },
    ),
    Effect(
        "bladder_elasticity",
        "muscle",
        "muscle",
        "passive elastic force of the bladder about the rest length",
        "F = F_static + k_1 s + k_3 s^3, s = L - rest_length; k_3 < 0: held from its largest on",
        "polynomial elastic force",
        {
            "linear": _P("k_1", "N/m", 0.0, 0.0, 1e5, "linear rate"),
            "cubic": _P("k_3", "N/m^3", 0.0, -1e9, 1e9, "cubic rate; below 0 it softens"),
        },
    ),
    Effect(
        "end_caps",
        "muscle",
        "muscle",
        "ends that are no cylinder: a factor on the contraction ratio",
        "force at eps' = k eps, eps = (rest_length - L)/rest_length",
        "Tondu and Lopez, IEEE Control Systems Magazine 20(2), 2000",
        {"factor": _P("k", "-", 1.0, 0.8, 1.5, "on the contraction ratio")},
    ),
    Effect(
        "braid_extensibility",
        "muscle",
        "muscle",
        "threads stretch with their tension: b grows, in the force and in the volume",
        "b = b_0/(1 - c_b P L), P gauge",
        _WORK + ", thread tension P b L/(2 pi n^2 N_t) over N_t threads of stiffness EA: "
        "c_b = b_0/(2 pi n^2 N_t EA)",
        {
            "compliance": _P(
                "c_b", "1/(Pa m)", 0.0, 0.0, 1e-6, "thread strain per pressure and length"
            )
        },
    ),
    Effect(
        "cable_compliance",
        "muscle",
        "muscle",
        "elastic series element between muscle and pulley",
        "L = L_path - c_c F, and the gas volume follows L",
        "series spring",
        {"compliance": _P("c_c", "m/N", 0.0, 0.0, 1e-3, "stretch per force")},
    ),
    Effect(
        "coulomb_friction",
        "joint",
        "joint",
        "dry friction at the joint",
        "torque = -T_c z, |z| <= 1, z turning by dq/q_p (Dahl); q_p = 0: z = sign(qd)",
        "Coulomb friction; presliding: Dahl, A solid friction model (1968)",
        {
            "torque": _P("T_c", "N m", 0.0, 0.0, 100.0, "magnitude"),
            "presliding_angle": _P(
                "q_p", "rad", 0.0, 0.0, 0.1, "elastic turn before it slides", True
            ),
        },
    ),
    Effect(
        "stribeck_friction",
        "joint",
        "joint",
        "dry friction that falls with speed",
        "torque = -(T_c + (T_s - T_c) exp(-(qd/w_s)^2)) z, z as in coulomb_friction",
        "Stribeck curve; presliding: Dahl, A solid friction model (1968)",
        {
            "static_torque": _P("T_s", "N m", 0.0, 0.0, 100.0, "at rest; T_c where below"),
            "torque": _P("T_c", "N m", 0.0, 0.0, 100.0, "at speed"),
            "speed": _P("w_s", "rad/s", 0.1, 1e-3, 10.0, "over which it falls", True),
            "presliding_angle": _P(
                "q_p", "rad", 0.0, 0.0, 0.1, "elastic turn before it slides", True
            ),
        },
    ),
    Effect(
        "viscous_friction",
        "joint",
        "joint",
        "more damping than written",
        "torque = -(viscous_friction + d_x) qd",
        "linear damping",
        {"extra": _P("d_x", "N m s/rad", 0.0, -1.0, 100.0, "added to viscous_friction")},
    ),
    Effect(
        "payload",
        "joint",
        "joint",
        "a point mass at a distance from the axis",
        "gravity_torque + m g l, inertia + m l^2, g = 9.80665 m/s^2",
        "rigid body",
        {
            "mass": _P("m", "kg", 0.0, 0.0, 100.0, "of the load"),
            "distance": _P("l", "m", 0.3, 0.0, 2.0, "from the joint's axis", True),
        },
    ),
    Effect(
        "pulley_radius",
        "joint",
        "joint",
        "the moment arm is not as written",
        "r = pulley_radius * s",
        "geometry",
        {"scale": _P("s", "-", 1.0, 0.5, 2.0, "true over written radius")},
    ),
    Effect(
        "position_offset",
        "sensing",
        "joint",
        "encoder zero",
        "q_measured = q + q_0",
        "sensor",
        {"offset": _P("q_0", "rad", 0.0, -1.0, 1.0, "added to the reading")},
    ),
    Effect(
        "position_delay",
        "sensing",
        "joint",
        "encoder stamped late",
        "q_measured(t) = q(t - t_q)",
        "sensor",
        {"delay": _P("t_q", "s", 0.0, 0.0, 0.2, "age of the reading at its stamp")},
    ),
    Effect(
        "pressure_gain",
        "sensing",
        "muscle",
        "one pressure sensor's gain",
        "p_measured = g p",
        "sensor",
        {"gain": _P("g", "-", 1.0, 0.5, 2.0, "reading over pressure")},
    ),
    Effect(
        "pressure_bias",
        "sensing",
        "muscle",
        "one pressure sensor's zero",
        "p_measured = p + p_0",
        "sensor",
        {"bias": _P("p_0", "Pa", 0.0, -1e5, 1e5, "added to the reading")},
    ),
    Effect(
        "pressure_lag",
        "sensing",
        "muscle",
        "the pressure sensor filters",
        "dp_measured/dt = (p - p_measured)/tau_p",
        "sensor",
        {"time_constant": _P("tau_p", "s", 0.0, 0.0, 0.5, "first order")},
    ),
)

EFFECTS: Mapping[str, Effect] = {effect.name: effect for effect in _TABLE}
"""Every effect by its name, in order from the command to the measurement."""


def effect_value(effects: EffectValues, effect: str, parameter: str) -> float:
    """One parameter of one effect, its neutral value where a rig does not name it.

    Parameters
    ----------
    effects : mapping
        `muscle.effects`, `joint.effects` or `rig.effects`.
    effect, parameter : str
        As in `EFFECTS`.
    """
    found = effects.get(effect)
    if found is not None and parameter in found:
        return found[parameter]
    return EFFECTS[effect].parameters[parameter].neutral
