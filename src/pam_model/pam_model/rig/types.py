"""A rig as data: the checked, immutable content of a rig file in SI units.

Pressures are gauge unless a field is named or described as absolute. `file.py` reads and writes it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pam_model.bounds import check_numbers, within
from pam_model.effects import EFFECTS, EffectValues, Scope
from pam_model.errors import RigError, UnknownNameError
from pam_model.muscles.force_model import ForceModel, MuscleGeometry, create_force_model
from pam_model.names import unknown
from pam_model.rig.keys import NUMBERS
from pam_model.rig.people import People
from pam_model.rig.wiring import Bus, Encoder, PressureSensor
from pam_model.rig.written_fields import effects_of, fields_of

ValveKind = Literal["flow", "pressure_regulator"]
VALVE_KINDS: tuple[ValveKind, ...] = ("flow", "pressure_regulator")


def _check(owner: object, section: str, where: str) -> None:
    """Check all numbers of one section against the bounds of a rig file.

    Raises
    ------
    RigError
        For a number that a rig file could not have.
    """
    bounds = {name: (key.low, key.high, key.unit) for name, key in NUMBERS[section].items()}
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
    """The gas in muscles and lines, and the ambient air.

    Attributes
    ----------
    temperature : float
        Of gas and ambient air [K].
    ambient_pressure : float
        [Pa absolute].
    polytropic_exponent : float
        1.0 isothermal to 1.4 adiabatic [-].
    """

    temperature: float = 293.15
    ambient_pressure: float = 101325.0
    polytropic_exponent: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, "gas", "gas")


@dataclass(frozen=True, slots=True)
class Valve:
    """One valve: a proportional flow valve, or a pressure regulator.

    Attributes
    ----------
    kind : str
        "flow" (spool command -1..1) or "pressure_regulator" (command in Pa gauge).
    sonic_conductance : float
        ISO 6358 C, fully open [m^3/(s Pa)].
    critical_ratio : float
        ISO 6358 b [-].
    time_constant : float
        Of the spool, first order [s]; of a pressure regulator, one over the corner frequency of
        its two poles [rad/s].
    full_scale : float or None
        Pressure regulator: set point at a command of 100 % [Pa gauge].
    damping : float or None
        Pressure regulator: damping ratio of these two poles [-]; None: 1, two equal real poles.
    """

    kind: ValveKind
    sonic_conductance: float
    critical_ratio: float = 0.3
    time_constant: float = 0.005
    full_scale: float | None = None
    damping: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        if self.kind not in VALVE_KINDS:
            raise RigError(unknown("kind of valve", self.kind, VALVE_KINDS))
        _check(self, "valve", "valve")


@dataclass(frozen=True, slots=True)
class Muscle:
    """One muscle with its valve.

    Attributes
    ----------
    name : str
        The name used in all messages.
    model : str
        Name of a registered force model.
    thread_length : float
        b, length of one braid thread [m].
    turns : float
        n, turns of one thread about the axis [-].
    rest_length : float
        Unpressurised braid length [m].
    neutral_length : float
        Length at joint position 0 [m].
    valve : Valve
        The valve that fills and vents it.
    max_pressure : float
        Limit above which the driver vents [Pa gauge].
    wall_thickness : float
        t_k [m].
    dead_volume : float
        Gas volume outside the braid [m^3].
    board, channel : int, str or None
        Board and channel that drive and measure it. A board is given by its number or by the name
        of its section in `Rig.boards`. The kind of board determines which numbers and channels
        exist. A rig for offline use needs neither.
    pressure_sensor : PressureSensor or None
        Another board and channel that measure its pressure; None: the same that drive it.
    model_parameters : mapping
        Constants of the force model.
    effects : mapping
        Effects that the nominal physics does not have, see `pam_model.effects`.
    """

    name: str
    model: str
    thread_length: float
    turns: float
    rest_length: float
    neutral_length: float
    valve: Valve
    max_pressure: float
    wall_thickness: float = 0.0
    dead_volume: float = 0.0
    board: int | str | None = None
    channel: int | str | None = None
    pressure_sensor: PressureSensor | None = None
    model_parameters: Mapping[str, float] = field(default_factory=dict)
    effects: EffectValues = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, "muscle", self.name)
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
    """One joint: a pulley between two muscles.

    Attributes
    ----------
    name : str
        The name used in all messages.
    muscles : tuple of str
        (agonist, antagonist); the agonist's force gives positive torque.
    pulley_radius : float
        [m].
    inertia : float
        [kg m^2].
    position_limits : tuple of float
        (lower, upper) [rad].
    viscous_friction : float
        [N m s/rad].
    gravity_torque : float
        m g l [N m]; torque = -gravity_torque sin(position - gravity_angle).
    gravity_angle : float
        [rad].
    max_velocity : float
        Largest speed of the joint [rad/s]. References stay below it, and the driver stops a joint
        that is measured to be faster.
    reduced_velocity : float
        Largest speed of the joint while full speed is not permitted, if the rig file has that
        input, see `People` [rad/s].
    max_acceleration : float
        Largest acceleration of a reference [rad/s^2].
    max_tracking_error : float
        Largest difference between reference and measurement that may last [rad].
    max_stiffness_rate : float
        Largest rate of change of the stiffness reference [N m/(rad s)].
    encoder : Encoder or None
        A rig for offline use needs none.
    effects : mapping
        Effects that the nominal physics does not have, see `pam_model.effects`.
    """

    name: str
    muscles: tuple[str, str]
    pulley_radius: float
    inertia: float
    position_limits: tuple[float, float]
    viscous_friction: float = 0.0
    gravity_torque: float = 0.0
    gravity_angle: float = 0.0
    max_velocity: float = 6.0
    reduced_velocity: float = 0.5
    max_acceleration: float = 200.0
    max_tracking_error: float = 0.5
    max_stiffness_rate: float = 50.0
    encoder: Encoder | None = None
    effects: EffectValues = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the numbers as a rig file's."""
        _check(self, "joint", self.name)
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

    Attributes
    ----------
    pressure_residual : float or None
        Difference between the measured pressure and the one expected from valve and gas [Pa].
    torque_share : float
        Difference between the torque of the measured pressures and the torque that the motion
        needs, over the torque of the agonist alone at its highest pressure [-].
    warning_share : float
        Part of any of these limits above which the driver warns [-].
    pressure_noise, position_noise : float or None
        Standard deviation between neighbouring samples [Pa], [rad].
    position_jump : float or None
        Change of a position between neighbouring samples [rad].
    position_margin : float
        Permitted distance of a joint beyond its position limits [rad].
    pressure_rate : float or None
        Largest rate of a pressure, taken over 10 ms [Pa/s].
    supply_share : float
        Lowest supply pressure over the nominal one, both gauge [-].
    supply_high_share : float
        Highest supply pressure over the nominal one, both gauge [-].
    """

    pressure_residual: float | None = None
    torque_share: float = 0.25
    warning_share: float = 0.5
    pressure_noise: float | None = None
    position_noise: float | None = None
    position_jump: float | None = None
    position_margin: float = 0.05
    pressure_rate: float | None = None
    supply_share: float = 0.5
    supply_high_share: float = 1.3

    def __post_init__(self) -> None:
        """Refuse what is no limit; a study may have sharper or wider ones than a rig file."""
        limits = {name: (0.0, math.inf, key.unit) for name, key in NUMBERS["plausibility"].items()}
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
    supply_pressure: float
    joints: tuple[Joint, ...]
    muscles: tuple[Muscle, ...]
    parameter_tolerance: float = 0.02
    length_tolerance: float | None = None
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
        _check(self, "", "")
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
