"""A rig as data: what a rig file says, checked, immutable, in SI units.

Pressures are gauge unless a field is named or described as absolute. `rig.py` reads and writes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pam_model.effects import EffectValues
from pam_model.muscles.force_model import ForceModel, MuscleGeometry, create_force_model

ValveKind = Literal["flow", "pressure_regulator"]


@dataclass(frozen=True, slots=True)
class Gas:
    """The gas in muscles and lines, and the air around.

    Attributes
    ----------
    temperature : float
        Of gas and ambient [K].
    ambient_pressure : float
        [Pa absolute].
    polytropic_exponent : float
        1.0 isothermal to 1.4 adiabatic [-].
    """

    temperature: float = 293.15
    ambient_pressure: float = 101325.0
    polytropic_exponent: float = 1.0


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
        Of the spool, first order [s].
    full_scale : float or None
        Pressure regulator: what a command of 100 % means [Pa gauge].
    """

    kind: ValveKind
    sonic_conductance: float
    critical_ratio: float = 0.3
    time_constant: float = 0.005
    full_scale: float | None = None


@dataclass(frozen=True, slots=True)
class Encoder:
    """Where a joint's angle is measured: a board, and the input on it, see `Muscle.board`."""

    board: int | str
    channel: int | str = 0


@dataclass(frozen=True, slots=True)
class Muscle:
    """One muscle with its valve.

    Attributes
    ----------
    name : str
        As in every array on every topic.
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
        What fills and empties it.
    max_pressure : float
        The driver vents above it [Pa gauge].
    wall_thickness : float
        t_k [m].
    dead_volume : float
        Gas volume beside the braid's own [m^3].
    board, channel : int, str or None
        Which board and channel drive and measure it: a board's number, or the name of its section
        in `Rig.boards`. What numbers and channels there are is known to the kind of board, not
        here. A rig for offline use needs none.
    model_parameters : mapping
        Constants of the force model.
    effects : mapping
        What the nominal physics leaves out, see `pam_model.effects`.
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
    model_parameters: Mapping[str, float] = field(default_factory=dict)
    effects: EffectValues = field(default_factory=dict)

    @property
    def geometry(self) -> MuscleGeometry:
        """What every force model needs of it."""
        return MuscleGeometry(self.thread_length, self.turns, self.rest_length, self.wall_thickness)

    def create_force_model(self) -> ForceModel:
        """Its static force model, without effects.

        Raises
        ------
        RigError, DomainError
            As `pam_model.muscles.force_model.create_force_model` does.
        """
        return create_force_model(self.model, self.geometry, self.model_parameters)


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint: a pulley between two muscles.

    Attributes
    ----------
    name : str
        As in every array on every topic.
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
    encoder : Encoder or None
        A rig for offline use needs none.
    effects : mapping
        What the nominal physics leaves out, see `pam_model.effects`.
    """

    name: str
    muscles: tuple[str, str]
    pulley_radius: float
    inertia: float
    position_limits: tuple[float, float]
    viscous_friction: float = 0.0
    gravity_torque: float = 0.0
    gravity_angle: float = 0.0
    encoder: Encoder | None = None
    effects: EffectValues = field(default_factory=dict)

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
    """From where on a measurement cannot be true, and the driver vents.

    Attributes
    ----------
    pressure_residual : float
        Pressure off what valve and gas should give [Pa].
    torque_share : float
        Torque of the pressures off what the motion needs, over that of the agonist alone at its
        highest pressure [-].
    warning_share : float
        Part of any of these limits from which on it is a warning [-].
    pressure_noise, position_noise : float
        Standard deviation between neighbouring samples [Pa], [rad].
    position_jump : float
        Change of an angle between neighbouring samples [rad].
    position_margin : float
        How far a joint may be beyond its limits [rad].
    pressure_rate : float
        Fastest change of a pressure, over 10 ms [Pa/s].
    supply_share : float
        Least supply pressure over the nominal one, both gauge [-].
    """

    pressure_residual: float = 100e3
    torque_share: float = 0.25
    warning_share: float = 0.5
    pressure_noise: float = 10e3
    position_noise: float = 0.02
    position_jump: float = 0.2
    position_margin: float = 0.05
    pressure_rate: float = 5e6
    supply_share: float = 0.5


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
        In the order of every array on every topic.
    muscles : tuple of Muscle
        Agonist, antagonist of each joint in turn; then those of no joint.
    parameter_tolerance : float
        How far a true value may lie from the written one, relative [-].
    effects : mapping
        Those that the whole rig shares.
    plausibility : Plausibility
        Limits of the driver's checks.
    boards : mapping of str to mapping
        The sections of boards that have a name: `kind`, `bus`, and what the kind of board reads.
        Only the driver looks into them.
    """

    gas: Gas
    supply_pressure: float
    joints: tuple[Joint, ...]
    muscles: tuple[Muscle, ...]
    parameter_tolerance: float = 0.02
    effects: EffectValues = field(default_factory=dict)
    plausibility: Plausibility = Plausibility()
    boards: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    _models: dict[str, ForceModel] = field(
        init=False, repr=False, compare=False, default_factory=dict
    )

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
        """Muscle -> kind of its valve, in order: what decides the field of a valve's command."""
        return {muscle.name: muscle.valve.kind for muscle in self.muscles}

    @property
    def supply_gauge_pressure(self) -> float:
        """Supply above ambient [Pa gauge]."""
        return self.supply_pressure - self.gas.ambient_pressure

    def joint(self, name: str) -> Joint:
        """The joint called `name`; KeyError if there is none."""
        return next((j for j in self.joints if j.name == name), None) or _no("joint", name)

    def muscle(self, name: str) -> Muscle:
        """The muscle called `name`; KeyError if there is none."""
        return next((m for m in self.muscles if m.name == name), None) or _no("muscle", name)

    def joint_of(self, muscle_name: str) -> Joint | None:
        """The joint that a muscle moves, None for a muscle on a bench."""
        return next((joint for joint in self.joints if muscle_name in joint.muscles), None)

    def force_model(self, muscle_name: str) -> ForceModel:
        """A muscle's nominal force model, made once.

        Raises
        ------
        KeyError
            For an unknown muscle.
        RigError, DomainError
            As `Muscle.create_force_model` does; a rig that was read from a file has been checked.
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

    def to_parameters(self) -> dict[str, Any]:
        """The nested mapping of a rig file, without `/**: ros__parameters:`."""
        tree: dict[str, Any] = {
            "gas": _fields(self.gas),
            "supply_pressure": self.supply_pressure,
            "parameter_tolerance": self.parameter_tolerance,
            "joints": list(self.joint_names),
        }
        bench = [m.name for m in self.muscles if self.joint_of(m.name) is None]
        if bench:
            tree["bench_muscles"] = bench
        if self.effects:
            tree["effects"] = _effects(self.effects)
        if self.plausibility != Plausibility():
            tree["plausibility"] = _fields(self.plausibility)
        if self.boards:
            tree["boards"] = {name: dict(section) for name, section in self.boards.items()}
        for joint in self.joints:
            tree[joint.name] = _fields(joint)
        for muscle in self.muscles:
            tree[muscle.name] = _fields(muscle)
        return tree


def _no(kind: str, name: str) -> Any:
    raise KeyError(f"no {kind} called {name!r}")


def _effects(effects: EffectValues) -> dict[str, dict[str, float]]:
    return {effect: dict(values) for effect, values in effects.items()}


def _fields(part: Any) -> dict[str, Any]:
    """A part's fields as a rig file writes them: no name, nothing empty."""
    tree: dict[str, Any] = {}
    for key in part.__dataclass_fields__:
        value = getattr(part, key)
        if key == "name" or value is None or value == {}:
            continue
        if isinstance(value, Valve | Encoder):
            value = _fields(value)
        elif key == "effects":
            value = _effects(value)
        elif isinstance(value, Mapping):
            value = dict(value)
        elif isinstance(value, tuple):
            value = list(value)
        tree[key] = value
    return tree
