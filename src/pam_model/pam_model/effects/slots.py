"""The slots: where an effect enters the plant, and the arguments of the law in each of them.

A law is a plain Python function of floats. The plant compiles it with numba if numba is
installed; estimator, controller and plausibility check call the same function. Each law takes the
arguments listed at its slot, followed by all parameters of the effect in the order of their
declaration; a parameter that the rig does not state has its neutral value. A law that is compiled
may call `math` and other plain functions of floats; it must not use arrays, strings or keyword
arguments.

Any number of effects may fill slots of one kind: their contributions are chained (Adjusts,
Opening) or added (Leak, PassivePull, PullState, DryFriction, JointTorque). Chamber, Thread and the
structural targets of Adjusts describe something that a rig has only once: if a second effect fills
one of them, the import fails.

Pressures are absolute in Leak and Chamber, gauge elsewhere. Flows are volume flows at the ISO 8778
reference density: mass flow over rho0 [m^3/s]. Only Chamber takes mass flows [kg/s].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

Law = Callable[..., float]
Law2 = Callable[..., tuple[float, float]]
Law3 = Callable[..., tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Target:
    """A number of the ideal rig that effects may change.

    Attributes
    ----------
    scope : str
        "joint" (once per plant) or "muscle".
    ideal : float or None
        Its value on the ideal rig; None if the rig file states the value.
    is_structural : bool
        Only one effect may change it.
    """

    scope: str
    ideal: float | None = None
    is_structural: bool = False


TARGETS: Mapping[str, Target] = {
    "joint.pulley_radius": Target("joint"),  # m
    "joint.inertia": Target("joint"),  # kg m^2
    "joint.viscous_friction": Target("joint"),  # N m s/rad
    "joint.gravity_torque": Target("joint"),  # N m
    "position_sensor.offset": Target("joint", 0.0),  # rad, added to the reading
    "position_sensor.delay": Target("joint", 0.0),  # s
    "reservoir.conductance": Target("joint", 0.0, True),  # m^3/(s Pa); 0: an ideal supply
    "reservoir.volume": Target("joint", 1e-3, True),  # m^3
    "dead_volume": Target("muscle"),  # m^3
    "contraction_factor": Target("muscle"),  # factor on the contraction ratio
    "threshold_pressure": Target("muscle", 0.0),  # Pa, below which nothing pulls
    "valve.time_constant": Target("muscle"),  # s
    "valve.exhaust_ratio": Target("muscle", 1.0),  # exhaust over supply conductance
    "valve.command_delay": Target("muscle", 0.0),  # s
    "tube.conductance": Target("muscle", 0.0, True),  # m^3/(s Pa); 0: no tube
    "tube.volume": Target("muscle", 1e-5, True),  # m^3
    "series_compliance": Target("muscle", 0.0),  # m/N, between muscle and pulley
    "pressure_sensor.gain": Target("muscle", 1.0),  # reading over pressure
    "pressure_sensor.bias": Target("muscle", 0.0),  # Pa, added after the gain
    "pressure_sensor.lag": Target("muscle", 0.0),  # s, first order, after gain and bias
}
"""The targets of Adjusts, by the plant's parameter names."""


@dataclass(frozen=True, slots=True)
class Adjusts:
    """Change a number of the ideal rig before the simulation begins.

    Attributes
    ----------
    target : str
        One of TARGETS.
    law : callable
        law(value, *parameters) -> value, in the target's unit.
    """

    context: ClassVar[tuple[str, ...]] = ("value",)
    target: str
    law: Law


@dataclass(frozen=True, slots=True)
class Opening:
    """Convert the spool position of a flow valve to its opening.

    Attributes
    ----------
    law : callable
        law(opening, *parameters) -> opening, -1 (exhaust) to 1 (supply).
    place : int
        Laws are applied in the order of their places; every place is unique.
    """

    context: ClassVar[tuple[str, ...]] = ("opening",)
    law: Law
    place: int


@dataclass(frozen=True, slots=True)
class Leak:
    """Gas that leaves the muscle; the flows of all effects are added.

    Attributes
    ----------
    law : callable
        law(pressure, ambient_pressure, critical_ratio, *parameters) -> flow out of the muscle;
        pressures absolute, flow over rho0 [m^3/s]; `critical_ratio` is the valve's.
    """

    context: ClassVar[tuple[str, ...]] = ("pressure", "ambient_pressure", "critical_ratio")
    law: Law


@dataclass(frozen=True, slots=True)
class Chamber:
    """Replace the polytropic chamber. Structural: only one effect may fill it.

    Attributes
    ----------
    law : callable
        law(pressure, temperature, volume, volume_per_pressure, flow_in, flow_out,
        wall_temperature, *parameters) -> (dP/dt [Pa/s], dT/dt [K/s]) at constant muscle length;
        mass flows [kg/s] calculated for gas at the wall temperature.
    exponent : float
        -dln P/dln V of the shut chamber for a sudden change of volume.
    heat_rate : callable
        heat_rate(mass, *parameters) -> rate at which the gas approaches wall temperature [1/s],
        so that the plant can choose a stable step.
    """

    context: ClassVar[tuple[str, ...]] = (
        "pressure",
        "temperature",
        "volume",
        "volume_per_pressure",
        "flow_in",
        "flow_out",
        "wall_temperature",
    )
    law: Law2
    exponent: float
    heat_rate: Law


@dataclass(frozen=True, slots=True)
class Thread:
    """The length of the threads under load. Structural: only one effect may fill it.

    Attributes
    ----------
    law : callable
        law(pressure, length, thread_length, *parameters) -> (stretched length b [m],
        db/dp [m/Pa], db/dL [-]); `thread_length` is that of the rig file.
    """

    context: ClassVar[tuple[str, ...]] = ("pressure", "length", "thread_length")
    law: Law3


@dataclass(frozen=True, slots=True)
class PassivePull:
    """A pull that depends only on the muscle's length; the pulls of all effects are added.

    Attributes
    ----------
    law : callable
        law(length, rest_length, *parameters) -> (pull [N], its slope dF/dL [N/m]).
    """

    context: ClassVar[tuple[str, ...]] = ("length", "rest_length")
    law: Law2


@dataclass(frozen=True, slots=True)
class PullState:
    """A dynamic state of the muscle and the pull it adds; each effect has its own state.

    The pulls of all effects are added. `braid_area` below is b^2/(4 pi n^2) [m^2]. `braid_slope` is
    6 rest_length/(4 pi n^2) [m], which is dF/dL of the braid at its rest length over its pressure.

    Attributes
    ----------
    name : str
        The state's name in the plant, such as "creep".
    pull : callable
        pull(state, pressure, braid_area, braid_slope, *parameters) -> (pull [N], dF/dp [m^2]).
    rate : callable
        rate(state, speed, step, *parameters) -> d state/dt; `speed` is dL/dt [m/s], `step` the
        integration step [s]; the rate of a fast state must be limited to stay stable with it.
    response : callable
        response(state, pressure, braid_area, braid_slope, *parameters) -> (dF/dL [N/m] that the
        state adds while the muscle lengthens, dF/dL while it shortens, dF/dt [N/s] at constant
        length): the plant needs them for a compliant cable.
    unsettled : callable
        unsettled(length, rest_length) -> the state of a muscle that was just moved from its rest
        length to `length`. 0 is the state of a muscle that has been at this length for long.
    """

    context: ClassVar[tuple[str, ...]] = ("state", "pressure", "braid_area", "braid_slope")
    name: str
    pull: Law2
    rate: Law
    response: Law3
    unsettled: Law


@dataclass(frozen=True, slots=True)
class DryFriction:
    """Dry friction at the joint, added over all effects; the plant handles sticking and sliding.

    Attributes
    ----------
    law : callable
        law(speed, *parameters) -> magnitude [N m] at a joint speed [rad/s].
    presliding : str
        Name of the parameter for the angle over which the contact yields before it slides [rad]. If
        there are several effects, the softest contact applies.
    """

    context: ClassVar[tuple[str, ...]] = ("speed",)
    law: Law
    presliding: str


@dataclass(frozen=True, slots=True)
class JointTorque:
    """A smooth torque at the joint; the torques of all effects are added.

    Attributes
    ----------
    law : callable
        law(position, speed, *parameters) -> torque [N m], positive in the direction of the
        agonist's pull.
    """

    context: ClassVar[tuple[str, ...]] = ("position", "speed")
    law: Law


Slot = (
    Adjusts
    | Opening
    | Leak
    | Chamber
    | Thread
    | PassivePull
    | PullState
    | DryFriction
    | JointTorque
)
SCOPES: Mapping[type, str] = {
    Opening: "muscle",
    Leak: "muscle",
    Chamber: "muscle",
    Thread: "muscle",
    PassivePull: "muscle",
    PullState: "muscle",
    DryFriction: "joint",
    JointTorque: "joint",
}
"""The scope that an effect must have to fill a slot; for Adjusts the target determines it."""


def laws_of(slot: Slot) -> Mapping[str, tuple[tuple[str, ...], Callable[..., object]]]:
    """The laws of a slot by name, each with the arguments before the effect's parameters."""
    if isinstance(slot, PullState):
        return {
            "pull": (slot.context, slot.pull),
            "rate": (("state", "speed", "step"), slot.rate),
            "response": (slot.context, slot.response),
        }
    laws: dict[str, tuple[tuple[str, ...], Callable[..., object]]] = {
        "law": (slot.context, slot.law)
    }
    if isinstance(slot, Chamber):
        laws["heat_rate"] = (("mass",), slot.heat_rate)
    return laws
