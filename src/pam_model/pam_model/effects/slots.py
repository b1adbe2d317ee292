"""Where an effect enters the plant: the slots, and what a law in each of them is given.

A law is a plain Python function of floats. The plant compiles it with numba where that is
installed; estimator, controller and plausibility check call the very same function. Each law
takes the arguments listed at its slot, followed by the effect's parameters in the order in which
the effect declares them, each at its value or at its neutral value. A law that is compiled may
call `math` and other plain functions of floats; it must not use arrays, strings or keyword
arguments.

Slots of one kind are filled by any number of effects: their contributions are chained (Adjusts,
Opening) or added (Leak, PassivePull, PullState, DryFriction, JointTorque). Chamber and Thread, and
the targets of Adjusts that are marked structural, describe one thing that a rig has once: a
second effect that fills one of them is refused at import.

Pressures are absolute in Leak and Chamber, gauge elsewhere. Flows are volume flows at the ISO 8778
reference density (mass flow over rho0) [m^3/s].
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
        Its value on the ideal rig; None where the rig file states it.
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
"""What Adjusts may name, by the plant's own parameter names."""


@dataclass(frozen=True, slots=True)
class Adjusts:
    """Changes a number of the ideal rig, before anything is simulated.

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
    """From the position of a flow valve's spool to its opening.

    Attributes
    ----------
    law : callable
        law(opening, *parameters) -> opening, -1 (exhaust) to 1 (supply).
    place : int
        Laws are applied in the order of their places; two effects cannot share one.
    """

    context: ClassVar[tuple[str, ...]] = ("opening",)
    law: Law
    place: int


@dataclass(frozen=True, slots=True)
class Leak:
    """Gas that leaves the muscle, added over all effects.

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
    """Replaces the polytropic chamber. Structural: one effect.

    Attributes
    ----------
    law : callable
        law(pressure, temperature, volume, volume_per_pressure, flow_in, flow_out,
        wall_temperature, *parameters) -> (dP/dt [Pa/s], dT/dt [K/s]) at constant muscle length;
        mass flows [kg/s] as at the wall temperature.
    exponent : float
        -dln P/dln V of the shut chamber under a sudden change of volume.
    heat_rate : callable
        heat_rate(mass, *parameters) -> rate at which the gas takes the wall's temperature [1/s],
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
    """The length of the braid's threads under load, in force and volume. Structural: one effect.

    Attributes
    ----------
    law : callable
        law(pressure, length, thread_length, *parameters) -> (stretched length b [m],
        db/dp [m/Pa], db/dL [-]); `thread_length` is the rig file's.
    """

    context: ClassVar[tuple[str, ...]] = ("pressure", "length", "thread_length")
    law: Law3


@dataclass(frozen=True, slots=True)
class PassivePull:
    """A pull that depends on the muscle's length alone, added over all effects.

    Attributes
    ----------
    law : callable
        law(length, rest_length, *parameters) -> (pull [N], its slope dF/dL [N/m]).
    """

    context: ClassVar[tuple[str, ...]] = ("length", "rest_length")
    law: Law2


@dataclass(frozen=True, slots=True)
class PullState:
    """A state of the muscle with a memory, and the pull it adds; one per effect, added.

    `braid_area` below is b^2/(4 pi n^2) [m^2], `braid_slope` is 6 rest_length/(4 pi n^2) [m]: the
    braid's dF/dL at its rest length over its pressure.

    Attributes
    ----------
    name : str
        The state's name in the plant, such as "creep".
    pull : callable
        pull(state, pressure, braid_area, braid_slope, *parameters) -> (pull [N], dF/dp [m^2]).
    rate : callable
        rate(state, speed, step, *parameters) -> d state/dt; `speed` is dL/dt [m/s], `step` the
        length of the integration step [s], which a fast state must not outrun.
    response : callable
        response(state, pressure, braid_area, braid_slope, *parameters) -> (dF/dL [N/m] that the
        state adds while the muscle lengthens, dF/dL while it shortens, dF/dt [N/s] at constant
        length): what a compliant cable sees of it.
    unsettled : callable
        unsettled(length, rest_length) -> the state of a muscle that was just brought to `length`
        from its rest length. 0 is the state of one that has been there for long.
    """

    context: ClassVar[tuple[str, ...]] = ("state", "pressure", "braid_area", "braid_slope")
    name: str
    pull: Law2
    rate: Law
    response: Law3
    unsettled: Law


@dataclass(frozen=True, slots=True)
class DryFriction:
    """Dry friction at the joint, added over all effects. The plant knows how to stick and slide.

    Attributes
    ----------
    law : callable
        law(speed, *parameters) -> magnitude [N m] at a joint speed [rad/s].
    presliding : str
        The parameter that holds the angle over which the contact yields before it slides [rad]; of
        several effects, the softest contact applies.
    """

    context: ClassVar[tuple[str, ...]] = ("speed",)
    law: Law
    presliding: str


@dataclass(frozen=True, slots=True)
class JointTorque:
    """A smooth torque at the joint, added over all effects.

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
"""The scope that an effect must have to fill a slot; that of Adjusts is its target's."""


def laws_of(slot: Slot) -> Mapping[str, tuple[tuple[str, ...], Callable[..., object]]]:
    """Every function of a slot by its name, with the arguments before the effect's parameters."""
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
