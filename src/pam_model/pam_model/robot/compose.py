"""The one place where a robot is made from a rig: effects applied, muscles attached to joints."""

from __future__ import annotations

from collections.abc import Callable

from pam_model.effects import EffectValues, adjusted, switched_on
from pam_model.effects.slots import SCOPES
from pam_model.muscles.force_model import ForceModel, MuscleGeometry
from pam_model.rig.arms import Arm, arms_of
from pam_model.rig.types import Joint, Muscle, Rig
from pam_model.robot.robot import (
    AppliedLaw,
    Robot,
    RobotJoint,
    RobotMuscle,
    RobotValve,
    Supply,
    Tube,
)
from pam_model.robot.static_force import static_force_model

Number = Callable[[str, float | None], float]


def compose(rig: Rig) -> Robot:
    """The robot that a rig file describes, with its effects applied.

    Parameters
    ----------
    rig : Rig
        As read from a file.

    Returns
    -------
    Robot
        Equal for two rigs of which one names an effect and the other one states the changed number.

    Raises
    ------
    RigError, DomainError
        As for `Rig.force_model`; never for a rig that was read from a file.
    """
    arms = arms_of(rig)
    of_rig = _numbers(rig.effects)
    supply = Supply(
        rig.supply_pressure,
        of_rig("reservoir.conductance", None),
        of_rig("reservoir.volume", None),
    )
    joints = tuple(
        _joint(place, joint, tuple(arm for arm in arms if arm.joint == place))
        for place, joint in enumerate(rig.joints)
    )
    muscles = tuple(
        _muscle(rig, place, muscle, tuple(arm for arm in arms if arm.muscle == place))
        for place, muscle in enumerate(rig.muscles)
    )
    return Robot(rig.gas, supply, joints, muscles, rig.plausibility, rig)


def _numbers(effects: EffectValues) -> Number:
    """A number of the ideal rig after the effects of one muscle, one joint or the rig."""
    return lambda target, written: adjusted(target, written, effects)


def _laws(effects: EffectValues, scope: str) -> tuple[AppliedLaw, ...]:
    """The laws that the effects add, slot by slot."""
    found: list[AppliedLaw] = []
    for kind, owner in SCOPES.items():
        if owner == scope:
            found += switched_on(kind, effects)
    return tuple(found)


def _joint(place: int, joint: Joint, arms: tuple[Arm, ...]) -> RobotJoint:
    number = _numbers(joint.effects)
    return RobotJoint(
        place=place,
        name=joint.name,
        arms=arms,
        inertia=number("joint.inertia", joint.inertia),
        viscous_friction=number("joint.viscous_friction", joint.viscous_friction),
        gravity_torque=number("joint.gravity_torque", joint.gravity_torque),
        gravity_angle=joint.gravity_angle,
        position_limits=joint.position_limits,
        max_velocity=joint.max_velocity,
        reduced_velocity=joint.reduced_velocity,
        max_acceleration=joint.max_acceleration,
        max_tracking_error=joint.max_tracking_error,
        max_stiffness_rate=joint.max_stiffness_rate,
        position_offset=number("position_sensor.offset", None),
        position_delay=number("position_sensor.delay", None),
        applied=_laws(joint.effects, "joint"),
    )


def _muscle(rig: Rig, place: int, muscle: Muscle, arms: tuple[Arm, ...]) -> RobotMuscle:
    number = _numbers(muscle.effects)
    return RobotMuscle(
        place=place,
        name=muscle.name,
        model=muscle.model,
        geometry=muscle.geometry,
        constants=tuple(sorted(muscle.model_parameters.items())),
        static_effects=_static_effects(number),
        force_model=effective_force_model(
            muscle.effects, muscle.geometry, rig.force_model(muscle.name)
        ),
        neutral_length=muscle.neutral_length,
        arms=arms,
        dead_volume=number("dead_volume", muscle.dead_volume),
        max_pressure=muscle.max_pressure,
        valve=_valve(muscle, number),
        pressure_gain=number("pressure_sensor.gain", None),
        pressure_bias=number("pressure_sensor.bias", None),
        pressure_lag=number("pressure_sensor.lag", None),
        applied=_laws(muscle.effects, "muscle"),
    )


def effective_force_model(
    effects: EffectValues, geometry: MuscleGeometry, nominal: ForceModel
) -> ForceModel:
    """The static force model of a muscle, with its effects applied to the nominal one."""
    laws = _laws(effects, "muscle")
    return static_force_model(nominal, geometry, *_static_effects(_numbers(effects)), laws)


def _static_effects(number: Number) -> tuple[float, float, float]:
    """Factor on the contraction ratio [-], threshold pressure [Pa], compliance [m/N]."""
    return (
        number("contraction_factor", 1.0),
        number("threshold_pressure", None),
        number("series_compliance", None),
    )


def _valve(muscle: Muscle, number: Number) -> RobotValve:
    valve = muscle.valve
    conductance = number("tube.conductance", None)
    tube = Tube(conductance, number("tube.volume", None)) if conductance > 0.0 else None
    return RobotValve(
        kind=valve.kind,
        sonic_conductance=valve.sonic_conductance,
        exhaust_ratio=number("valve.exhaust_ratio", None),
        critical_ratio=valve.critical_ratio,
        time_constant=number("valve.time_constant", valve.time_constant),
        damping=1.0 if valve.damping is None else valve.damping,
        command_delay=number("valve.command_delay", None),
        full_scale=valve.full_scale,
        tube=tube,
    )
