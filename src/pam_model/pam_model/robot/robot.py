"""A robot as the numbers that hold: every effect that changes a number is applied already.

A `Rig` is the file as written. In a `Robot`, effects of the rig file that change a number of the
ideal rig (a payload, a dead volume, a narrower exhaust) are part of the numbers. The other effects
remain laws of the muscle or joint that has them (`laws`). Thus, an effect and the same change
written as plain numbers give equal robots. `pam_model.robot.compose` is the only place that makes
a `Robot`.

The topology is data: `joints` and `muscles` are tuples of any length, and an `Arm` says which
muscle turns which joint. Pressures are gauge unless an attribute says absolute.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from pam_model.effects import Effect
from pam_model.effects.slots import Slot
from pam_model.muscles.force_model import ForceModel, MuscleGeometry
from pam_model.rig.arms import Arm
from pam_model.rig.types import Gas, Plausibility, Rig, ValveKind

AppliedLaw = tuple[Effect, Slot, tuple[float, ...]]
"""An effect that is switched on, one of its slots, and the values of its parameters."""


@dataclass(frozen=True, slots=True)
class Supply:
    """The one supply of all valves: a reservoir that is refilled through a restriction."""

    pressure: float  # of the source, and of the full reservoir [Pa absolute]
    # ISO 6358 C of the refill path [m^3/(s Pa)]; 0: an ideal supply, which never sags
    refill_conductance: float
    reservoir_volume: float  # [m^3]; has no meaning for an ideal supply

    @property
    def is_ideal(self) -> bool:
        """Whether its pressure is constant."""
        return not self.refill_conductance > 0.0


@dataclass(frozen=True, slots=True)
class Tube:
    """A tube between valve and muscle; the pressure sensor is on the valve's side."""

    conductance: float  # ISO 6358 C [m^3/(s Pa)]
    volume: float  # [m^3]


class _HasLaws(Protocol):
    @property
    def applied(self) -> tuple[AppliedLaw, ...]: ...


def _laws(owner: _HasLaws, kind: type[Any], treatment: type | None) -> list[Any]:
    return [
        law
        for law in owner.applied
        if isinstance(law[1], kind) and (treatment is None or isinstance(law[0].control, treatment))
    ]


@dataclass(frozen=True, slots=True)
class RobotValve:
    """The valve of one muscle."""

    kind: ValveKind  # "flow" or "pressure_regulator"
    sonic_conductance: float  # ISO 6358 C of the supply path, fully open [m^3/(s Pa)]
    exhaust_ratio: float  # conductance of the exhaust path over that of the supply path [-]
    critical_ratio: float  # ISO 6358 b [-]
    time_constant: float  # of the spool, or of each pole of a pressure regulator [s]
    damping: float  # of the two poles of a pressure regulator [-]
    command_delay: float  # [s]
    full_scale: float | None  # pressure regulator: set point at a command of 100 % [Pa gauge]
    tube: Tube | None  # between valve and muscle

    @property
    def follows_after(self) -> float:
        """Time by which slow commands are followed late, without the delay of the command [s]."""
        if self.kind == "flow":
            return self.time_constant
        return 2.0 * self.damping * self.time_constant


@dataclass(frozen=True, slots=True)
class RobotMuscle:
    """One muscle with its valve and its pressure sensor."""

    place: int  # in `Robot.muscles`
    name: str  # as in the rig file
    # model, geometry, constants, static_effects: name, braid and constants of the force model,
    # factor on the contraction and compliance of the cable: with the laws in `applied`, the static
    # force follows from them
    model: str
    geometry: MuscleGeometry
    constants: tuple[tuple[str, float], ...]
    static_effects: tuple[float, ...]
    # the static force, with the effects that change it
    force_model: ForceModel = field(compare=False, repr=False)
    neutral_length: float  # at position 0 of all its joints [m]
    arms: tuple[Arm, ...]  # the joints that it turns; empty for a bench muscle
    dead_volume: float  # gas volume outside the braid, at least 0 [m^3]
    max_pressure: float  # limit above which the driver vents [Pa gauge]
    valve: RobotValve  # the valve that fills and vents it
    # pressure_gain, pressure_bias, pressure_lag: of its pressure sensor: reading over pressure [-],
    # zero [Pa], first order lag [s]
    pressure_gain: float
    pressure_bias: float
    pressure_lag: float
    applied: tuple[AppliedLaw, ...]  # the effects that are laws rather than numbers

    def laws[S: Slot](
        self, kind: type[S], treatment: type | None = None
    ) -> list[tuple[Effect, S, tuple[float, ...]]]:
        """The laws of one kind of slot, in the order in which the plant applies them.

        Parameters
        ----------
        kind : type
            A class of `pam_model.effects.slots`.
        treatment : type, optional
            Only effects that the controller treats in this way.
        """
        return _laws(self, kind, treatment)


@dataclass(frozen=True, slots=True)
class RobotJoint:
    """One joint."""

    place: int  # in `Robot.joints`
    name: str  # as in the rig file
    arms: tuple[Arm, ...]  # the muscles that turn it, in the order of the rig file
    inertia: float  # [kg m^2]
    viscous_friction: float  # [N m s/rad]
    # gravity_torque, gravity_angle: torque = -gravity_torque sin(position - gravity_angle) [N m],
    # [rad]
    gravity_torque: float
    gravity_angle: float
    position_limits: tuple[float, float]  # [rad]
    # max_velocity, reduced_velocity: largest speed, and while full speed is not permitted [rad/s]
    max_velocity: float
    reduced_velocity: float
    # max_acceleration, max_tracking_error, max_stiffness_rate: limits of motion of the rig file
    # [rad/s^2], [rad], [N m/(rad s)]
    max_acceleration: float
    max_tracking_error: float
    max_stiffness_rate: float
    # position_offset, position_delay: of its encoder: added to the reading [rad], [s]
    position_offset: float
    position_delay: float
    applied: tuple[AppliedLaw, ...]  # the effects that are laws rather than numbers

    @property
    def muscles(self) -> tuple[int, ...]:
        """The places of its muscles in the robot."""
        return tuple(arm.muscle for arm in self.arms)

    def laws[S: Slot](
        self, kind: type[S], treatment: type | None = None
    ) -> list[tuple[Effect, S, tuple[float, ...]]]:
        """As `RobotMuscle.laws`."""
        return _laws(self, kind, treatment)


@dataclass(frozen=True, slots=True)
class Robot:
    """Joints, muscles and one supply, as the numbers that hold."""

    gas: Gas  # gas and ambient
    supply: Supply  # the supply of all valves
    joints: tuple[RobotJoint, ...]  # in the rig file's order
    muscles: tuple[RobotMuscle, ...]  # in the rig file's order
    plausibility: Plausibility  # limits of the driver's checks
    # the file as written, for wiring and messages; its numbers are not those that hold
    rig: Rig = field(compare=False, repr=False)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def muscle_names(self) -> tuple[str, ...]:
        """Names of the muscles, in order."""
        return tuple(muscle.name for muscle in self.muscles)

    @property
    def supply_gauge_pressure(self) -> float:
        """Of the full supply [Pa gauge]."""
        return self.supply.pressure - self.gas.ambient_pressure

    def joint(self, name: str) -> RobotJoint:
        """The joint with this name; UnknownNameError if there is none."""
        return self.joints[self.rig.joint_number(name)]

    def muscle(self, name: str) -> RobotMuscle:
        """The muscle with this name; UnknownNameError if there is none."""
        self.rig.muscle(name)
        return self.muscles[self.muscle_names.index(name)]
