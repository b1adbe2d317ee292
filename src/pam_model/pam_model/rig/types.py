"""A rig as data: the checked, immutable content of a rig file in SI units.

Pressures are gauge unless a field is named or described as absolute. `file.py` reads and writes it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final, Literal

from pam_model.bounds import check_numbers, within
from pam_model.effects import EFFECTS, EffectValues, Scope
from pam_model.errors import RigError, UnknownNameError
from pam_model.muscles.force_model import ForceModel, MuscleGeometry, create_force_model
from pam_model.names import unknown
from pam_model.rig.keys import Key, keys_of
from pam_model.rig.people import People
from pam_model.rig.wiring import Bus, Encoder, PressureSensor
from pam_model.rig.written_fields import effects_of, fields_of

ValveKind = Literal["flow", "pressure_regulator"]
TURN = 2.0 * math.pi
POSITION_LIMITS = Key("rad", -TURN, TURN, text="lowest and highest position of the joint")
VALVE_KINDS: tuple[ValveKind, ...] = ("flow", "pressure_regulator")


def _check(owner: Any, where: str) -> None:
    """Check all numbers of a part of a rig against the bounds of a rig file.

    Raises
    ------
    RigError
        For a number that a rig file could not have.
    """
    keys = keys_of(type(owner))  # type: ignore[arg-type]  # mypy takes no class for hashable
    bounds = {name: (key.low, key.high, key.unit) for name, key in keys.items()}
    check_numbers(owner, where, bounds, error=RigError)


def _check_effects(effects: EffectValues, scope: Scope, where: str) -> None:
    """Check the values of effects against the bounds of their parameters.

    Raises
    ------
    RigError
        For an unknown effect or parameter, one of another scope, or a value out of bounds.
    """
    prefix = f"{where}.effects" if where else "effects"
    known = [name for name, effect in EFFECTS.items() if effect.scope == scope]
    for name, values in effects.items():
        if name not in known:
            raise RigError(f"{prefix}: {unknown('effect', name, known)}")
        parameters = EFFECTS[name].parameters
        for key, value in values.items():
            if key not in parameters:
                raise RigError(f"{prefix}.{name}: {unknown('parameter', key, parameters)}")
            entry = parameters[key]
            what = f"{prefix}.{name}.{key}"
            within(what, value, entry.low, entry.high, entry.unit, error=RigError)


@dataclass(frozen=True, slots=True)
class Gas:
    """The gas in muscles and lines, and the ambient air."""

    # fmt: off
    temperature: Annotated[float, Key("K", 200.0, 400.0, text="of gas and ambient")] = 293.15
    ambient_pressure: Annotated[float, Key("Pa absolute", 3e4, 1.3e5,
        text="pressure around the robot")] = 101325.0
    polytropic_exponent: Annotated[float, Key("-", 1.0, 1.4,
        text="1.0 isothermal (nominal) to 1.4 adiabatic")] = 1.0
    # fmt: on

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, "gas")


@dataclass(frozen=True, slots=True)
class Valve:
    """One valve: a proportional flow valve, or a pressure regulator."""

    kind: ValveKind  # "flow" (spool command -1..1) or "pressure_regulator" (command in Pa gauge)
    # fmt: off
    sonic_conductance: Annotated[float, Key("m^3/(s Pa)", 1e-12, 1e-5, guess=5e-9,
        text="ISO 6358 C, fully open")]
    critical_ratio: Annotated[float, Key("-", 0.0, 0.99, guess=0.3, text="ISO 6358 b")] = 0.3
    # of a pressure regulator, one over the corner frequency of its two poles [rad/s]
    time_constant: Annotated[float, Key("s", 1e-5, 2.0, guess=0.008,
        text="of the spool, first order; pressure regulator: of each of its two poles")] = 0.005
    full_scale: Annotated[float | None, Key("Pa gauge", 1e4, 2.5e6, by_size=True,
        text="pressure regulator: what a command of 100 % means")] = None
    damping: Annotated[float | None, Key("-", 0.1, 3.0, by_size=True,
        text="pressure regulator: damping ratio of its two poles (without: 1); below 1 it "
             "overshoots")] = None
    # fmt: on

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        if self.kind not in VALVE_KINDS:
            raise RigError(unknown("kind of valve", self.kind, VALVE_KINDS))
        _check(self, "valve")


@dataclass(frozen=True, slots=True)
class Muscle:
    """One muscle with its valve."""

    name: str  # as in all messages
    model: str  # name of a registered force model
    # fmt: off
    thread_length: Annotated[float, Key("m", 5e-3, 10.0, is_measured=True,
        text="b, length of one thread of the braid")]
    turns: Annotated[float, Key("-", 1e-2, 1e3, is_measured=True,
        text="n, turns of one thread about the axis")]
    rest_length: Annotated[float, Key("m", 5e-3, 10.0, text="unpressurised braid length")]
    neutral_length: Annotated[float, Key("m", 5e-3, 10.0, is_measured=True,
        text="length at joint position 0")]
    valve: Valve  # the valve that fills and vents it
    max_pressure: Annotated[float, Key("Pa gauge", 1e4, 2.5e6, text="the driver vents above it")]
    wall_thickness: Annotated[float, Key("m", 0.0, 0.02, text="t_k, bladder and sheath")] = 0.0
    dead_volume: Annotated[float, Key("m^3", 0.0, 0.015, guess=2e-5,
        text="gas volume outside the braid (fittings, tube)")] = 0.0
    # fmt: on
    # board, channel: what drives and measures it. A board is given by its number or by the name of
    # its section in `Rig.boards`. The kind of board determines which numbers and channels exist. A
    # rig for offline use needs neither.
    board: int | str | None = None
    channel: int | str | None = None
    # another board and channel that measure its pressure; None: the same that drive it
    pressure_sensor: PressureSensor | None = None
    # constants of the force model
    model_parameters: Mapping[str, float] = field(default_factory=dict)
    # effects that the nominal physics does not have, see `pam_model.effects`
    effects: EffectValues = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, self.name)
        _check_effects(self.effects, "muscle", self.name)

    @property
    def geometry(self) -> MuscleGeometry:
        """The geometry that every force model needs."""
        return MuscleGeometry(self.thread_length, self.turns, self.rest_length, self.wall_thickness)

    def with_valve_of(self, other: Muscle) -> Muscle:
        """The same muscle behind the valve and the pressure sensor of another one."""
        own = {n: each for n, each in self.effects.items() if not EFFECTS[n].is_of_the_valve}
        moved = {n: each for n, each in other.effects.items() if EFFECTS[n].is_of_the_valve}
        return replace(
            self,
            valve=other.valve,
            board=other.board,
            channel=other.channel,
            pressure_sensor=other.pressure_sensor,
            effects=own | moved,
        )

    def create_force_model(self) -> ForceModel:
        """Its static force model, without effects.

        Raises
        ------
        RigError, DomainError
            As for `pam_model.muscles.force_model.create_force_model`.
        """
        return create_force_model(self.model, self.geometry, self.model_parameters)


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint: a pulley between two muscles."""

    name: str  # as in all messages
    muscles: tuple[str, str]  # (agonist, antagonist); the agonist's force gives positive torque
    # fmt: off
    pulley_radius: Annotated[float, Key("m", 1e-3, 0.5, is_measured=True,
        text="radius at which the tendons of both muscles pull")]
    inertia: Annotated[float, Key("kg m^2", 1e-8, 1e3, guess=1e-3, text="about the joint's axis")]
    position_limits: tuple[float, float]  # (lower, upper) [rad]
    viscous_friction: Annotated[float, Key("N m s/rad", 0.0, 1e3, guess=1e-3,
        text="torque of the joint's own damping over its speed")] = 0.0
    gravity_torque: Annotated[float, Key("N m", -1e4, 1e4, guess=0.0,
        text="m g l; torque = -gravity_torque sin(position - gravity_angle); 0 on a joint with a "
             "vertical axis")] = 0.0
    gravity_angle: Annotated[float, Key("rad", -TURN, TURN, guess=0.0,
        text="position at which gravity exerts no torque")] = 0.0
    max_velocity: Annotated[float, Key("rad/s", 0.01, 100.0,
        text="largest speed of the joint; references keep 60 % of it, and the driver stops a joint "
             "that is measured to be faster")] = 6.0
    # only with that input, see `People`
    reduced_velocity: Annotated[float, Key("rad/s", 0.01, 100.0,
        text="the same while full speed is not permitted")] = 0.5
    max_acceleration: Annotated[float, Key("rad/s^2", 0.1, 1e5,
        text="largest acceleration of a reference")] = 200.0
    max_tracking_error: Annotated[float, Key("rad", 1e-3, 10.0, by_size=True,
        text="largest difference between reference and measurement that may last")] = 0.5
    max_stiffness_rate: Annotated[float, Key("N m/(rad s)", 1e-2, 1e5,
        text="largest rate of change of the stiffness reference")] = 50.0
    # fmt: on
    encoder: Encoder | None = None  # a rig for offline use needs none
    # effects that the nominal physics does not have, see `pam_model.effects`
    effects: EffectValues = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, self.name)
        _check_effects(self.effects, "joint", self.name)

    def counted_the_other_way(self) -> Joint:
        """The same joint for an encoder that counts the other way: its muscles change sides."""
        lower, upper = self.position_limits
        return replace(
            self,
            muscles=(self.antagonist, self.agonist),
            position_limits=(-upper, -lower),
            gravity_angle=-self.gravity_angle,
            effects={
                name: EFFECTS[name].counted_the_other_way(values)
                for name, values in self.effects.items()
            },
        )

    @property
    def agonist(self) -> str:
        """Name of the muscle that pulls towards positive positions."""
        return self.muscles[0]

    @property
    def antagonist(self) -> str:
        """Name of the muscle that pulls towards negative positions."""
        return self.muscles[1]


@dataclass(frozen=True, slots=True)
class Plausibility:
    """Limits beyond which a measurement is implausible, so that the driver vents.

    Those that are None follow from the size of muscle or joint, see
    `pam_driver.safety.limits_by_size`.
    """

    # fmt: off
    pressure_residual: Annotated[float | None, Key("Pa", 1e3, 2.5e6, by_size=True,
        text="deviation of a pressure from what valve and gas should give")] = None
    torque_share: Annotated[float, Key("-", 0.01, 100.0,
        text="deviation of the torque of the pressures from what the motion needs, divided by the "
             "torque of the agonist at its highest pressure")] = 0.25
    warning_share: Annotated[float, Key("-", 0.05, 1.0,
        text="share of any of these limits at which a warning begins")] = 0.5
    pressure_noise: Annotated[float | None, Key("Pa", 10.0, 2.5e6, by_size=True,
        text="standard deviation between neighbouring samples")] = None
    position_noise: Annotated[float | None, Key("rad", 1e-4, 10.0, by_size=True,
        text="standard deviation of neighbouring samples")] = None
    position_jump: Annotated[float | None, Key("rad", 1e-3, 10.0, by_size=True,
        text="change of an angle between neighbouring samples")] = None
    position_margin: Annotated[float, Key("rad", 0.0, 10.0,
        text="how far the angle of a joint may exceed position_limits")] = 0.05
    pressure_rate: Annotated[float | None, Key("Pa/s", 1e4, 1e9, by_size=True,
        text="fastest plausible change of a pressure, over 10 ms")] = None
    supply_share: Annotated[float, Key("-", 0.0, 1.0,
        text="lowest supply pressure divided by the nominal one, both gauge")] = 0.5
    supply_high_share: Annotated[float, Key("-", 1.01, 100.0,
        text="highest supply pressure divided by the nominal one, both gauge")] = 1.3
    # fmt: on

    def __post_init__(self) -> None:
        """Refuse what is no limit; a study may have sharper or wider ones than a rig file."""
        limits = {name: (0.0, math.inf, key.unit) for name, key in keys_of(Plausibility).items()}
        check_numbers(self, "plausibility", limits, error=RigError)


@dataclass(frozen=True)
class Rig:
    """A robot of antagonistic joints, or a bench of single muscles.

    Attributes
    ----------
    gas : Gas
        Gas and ambient.
    supply_pressure : float
        [Pa absolute].
    joints : tuple of Joint
        In the order used in all messages.
    muscles : tuple of Muscle
        Agonist and antagonist of each joint, then the bench muscles, which have no joint.
    parameter_tolerance : float
        Relative tolerance of the values in the rig file [-].
    length_tolerance : float or None
        Relative tolerance of lengths and turns [-], which are measured better than other values;
        None if it is `parameter_tolerance`.
    effects : mapping
        Effects of the whole rig.
    plausibility : Plausibility
        Limits of the driver's checks.
    people : People
        Inputs for people on which the driver insists.
    boards : mapping of str to mapping
        The sections of named boards: `kind`, `bus`, and further keys of this kind of board. Only
        the driver uses them.
    buses : mapping of str to Bus
        The buses by name; empty for a robot with one bus, which the parameters of the nodes name.
    """

    gas: Gas
    # fmt: off
    supply_pressure: Annotated[float, Key("Pa absolute", 1.05e5, 2.5e6, is_measured=True,
        text="what the valves draw from")]
    joints: tuple[Joint, ...]
    muscles: tuple[Muscle, ...]
    parameter_tolerance: Annotated[float, Key("-", 0.0, 0.5,
        text="how far the true value of a number may be from the written one, relative (0.02 = 2 "
             "%)")] = 0.02
    length_tolerance: Annotated[float | None, Key("-", 0.0, 0.5, by_size=True,
        text="the same for pulley radius, thread length, turns, neutral length and wall "
             "thickness")] = None
    # fmt: on
    effects: EffectValues = field(default_factory=dict)
    plausibility: Plausibility = Plausibility()
    people: People = field(default_factory=People)
    boards: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    buses: Mapping[str, Bus] = field(default_factory=dict)
    _models: dict[str, ForceModel] = field(
        init=False, repr=False, compare=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, "")
        _check_effects(self.effects, "rig", "")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def muscle_names(self) -> tuple[str, ...]:
        """Names of the muscles, in order."""
        return tuple(muscle.name for muscle in self.muscles)

    @property
    def valve_kinds(self) -> dict[str, ValveKind]:
        """Muscle -> kind of its valve, in order; the kind decides the unit of the command."""
        return {muscle.name: muscle.valve.kind for muscle in self.muscles}

    @property
    def supply_gauge_pressure(self) -> float:
        """Supply above ambient [Pa gauge]."""
        return self.supply_pressure - self.gas.ambient_pressure

    def joint(self, name: str | int) -> Joint:
        """The joint with this name or number; UnknownNameError if there is none."""
        return self.joints[self.joint_number(name)]

    def joint_number(self, name: str | int) -> int:
        """The place of a joint in `joints`, by its name or number.

        Raises
        ------
        UnknownNameError
            If there is none.
        """
        if isinstance(name, int) and 0 <= name < len(self.joints):
            return name
        if name in self.joint_names:
            return self.joint_names.index(str(name))
        raise UnknownNameError(unknown("joint", name, self.joint_names))

    def muscle(self, name: str) -> Muscle:
        """The muscle called `name`; UnknownNameError if there is none."""
        for muscle in self.muscles:
            if muscle.name == name:
                return muscle
        raise UnknownNameError(unknown("muscle", name, self.muscle_names))

    def joint_of(self, muscle_name: str) -> Joint | None:
        """The joint that a muscle moves; None for a bench muscle."""
        self.muscle(muscle_name)
        return next((joint for joint in self.joints if muscle_name in joint.muscles), None)

    def force_model(self, muscle_name: str) -> ForceModel:
        """A muscle's nominal force model; it is created once.

        Raises
        ------
        UnknownNameError
            For an unknown muscle.
        RigError, DomainError
            As for `Muscle.create_force_model`; never for a rig that was read from a file.
        """
        model = self._models.get(muscle_name)
        if model is None:
            model = self.muscle(muscle_name).create_force_model()
            self._models[muscle_name] = model
        return model

    def with_muscle(self, muscle: Muscle) -> Rig:
        """A copy in which this muscle replaces the one of its name."""
        self.muscle(muscle.name)
        muscles = tuple(muscle if m.name == muscle.name else m for m in self.muscles)
        return replace(self, muscles=muscles)

    def with_joint(self, joint: Joint) -> Rig:
        """A copy in which this joint replaces the one of its name."""
        self.joint(joint.name)
        joints = tuple(joint if j.name == joint.name else j for j in self.joints)
        return replace(self, joints=joints)

    def without_effects(self) -> Rig:
        """The ideal rig: a copy that has no effects."""
        return replace(
            self,
            effects={},
            joints=tuple(replace(joint, effects={}) for joint in self.joints),
            muscles=tuple(replace(muscle, effects={}) for muscle in self.muscles),
        )

    def to_parameters(self) -> dict[str, Any]:
        """The nested mapping of a rig file, without `/**: ros__parameters:`."""
        tree: dict[str, Any] = {
            "gas": fields_of(self.gas),
            "supply_pressure": self.supply_pressure,
            "parameter_tolerance": self.parameter_tolerance,
            "joints": list(self.joint_names),
        }
        if self.length_tolerance is not None:
            tree["length_tolerance"] = self.length_tolerance
        bench = [m.name for m in self.muscles if self.joint_of(m.name) is None]
        if bench:
            tree["bench_muscles"] = bench
        if self.effects:
            tree["effects"] = effects_of(self.effects)
        if self.plausibility != Plausibility():
            tree["plausibility"] = fields_of(self.plausibility)
        if self.buses:
            tree["buses"] = {name: fields_of(bus) for name, bus in self.buses.items()}
        if self.people != People():
            tree["people"] = fields_of(self.people)
        if self.boards:
            tree["boards"] = {name: dict(section) for name, section in self.boards.items()}
        for joint in self.joints:
            tree[joint.name] = fields_of(joint)
        for muscle in self.muscles:
            tree[muscle.name] = fields_of(muscle)
        return tree


NUMBERS: Final[Mapping[str, Mapping[str, Key]]] = {
    "": keys_of(Rig),
    "gas": keys_of(Gas),
    "bus": keys_of(Bus),
    "joint": keys_of(Joint),
    "muscle": keys_of(Muscle),
    "valve": keys_of(Valve),
    "people": keys_of(People),
    "plausibility": keys_of(Plausibility),
}
"""Every number of a rig file, by section ("" is the top level)."""
