"""What a trial of the campaign may do at most, from the limits in the rig file.

None of these numbers is measured: they follow from the largest pressures, the valves, the muscle
models and the limits of the joints. The campaign compares every trial with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pam_driver.driver_settings import DriverSettings
from pam_model.gas import pressure_rate, valve_flow
from pam_model.rig import Rig
from pam_model.robot import Robot, RobotMuscle, compose
from pam_model.views.gas_volume import largest_gas_volume
from pam_model.views.gravity import largest_gravity_torque
from pam_model.views.muscle_path import lengths_over_travel

EMPTY: Final = 20e3  # Pa gauge; below it a muscle counts as empty
_STEP: Final = 1e-3  # s
_LENGTHS: Final = 17
_NEVER: Final = 60.0  # s; a valve that takes longer does not empty its muscle


@dataclass(frozen=True, slots=True)
class RigBounds:
    """The largest permitted values on one rig.

    Attributes
    ----------
    exhaust_time : float
        Time in which every valve empties its muscle from its largest pressure to `EMPTY`, if the
        muscle keeps its largest volume and the gas its temperature [s].
    pressure : float
        Largest pressure in a muscle: `max_pressure` and the margin of the driver [Pa gauge].
    force : float
        Largest force of a muscle at this pressure within the joint's position limits [N].
    filled_pressure, filled_force : float
        The same for a muscle that a stuck valve fills: up to the supply, if that is more.
    heavy : bool
        Whether every joint is so heavy that a muscle with `EMPTY` cannot lift it; only such a joint
        has a way up.
    speed : float
        Smallest `max_velocity` of the joints [rad/s].
    tracking_error : float
        Smallest `max_tracking_error` of the joints [rad].
    position : tuple of float
        Least and greatest angle of the first joint, with the margin of the end stops [rad].
    """

    exhaust_time: float
    pressure: float
    force: float
    filled_pressure: float
    filled_force: float
    heavy: bool
    speed: float
    tracking_error: float
    position: tuple[float, float]


def bounds_of(rig: Rig) -> RigBounds:
    """The bounds of a rig whose muscles belong to joints."""
    margin, robot = DriverSettings().over_pressure_margin, compose(rig)
    most, supply = max(one.max_pressure for one in robot.muscles), robot.supply_gauge_pressure
    low, high = robot.joints[0].position_limits
    stop = robot.plausibility.position_margin
    return RigBounds(
        exhaust_time=max(_exhaust_time(robot, muscle) for muscle in robot.muscles),
        pressure=most + margin,
        force=max(
            _largest_pull(robot, muscle, muscle.max_pressure + margin) for muscle in robot.muscles
        ),
        filled_pressure=max(most, supply) + margin,
        filled_force=max(
            _largest_pull(robot, muscle, max(muscle.max_pressure, supply) + margin)
            for muscle in robot.muscles
        ),
        heavy=all(
            largest_gravity_torque(robot.joints[arm.joint])
            > abs(arm.length) * _largest_pull(robot, muscle, EMPTY)
            for muscle in robot.muscles
            for arm in muscle.arms
        ),
        speed=min(joint.max_velocity for joint in robot.joints),
        tracking_error=min(joint.max_tracking_error for joint in robot.joints),
        position=(low - stop, high + stop),
    )


def _largest_pull(robot: Robot, muscle: RobotMuscle, pressure: float) -> float:
    lengths = lengths_over_travel(robot, muscle, _LENGTHS)
    return max(float(muscle.force_model.force(pressure, length)) for length in lengths)


def _exhaust_time(robot: Robot, muscle: RobotMuscle) -> float:
    volume = largest_gas_volume(robot, muscle)
    ambient, temperature = robot.gas.ambient_pressure, robot.gas.temperature
    pressure, time = ambient + muscle.max_pressure, 0.0
    while pressure > ambient + EMPTY and time < _NEVER:
        flow = valve_flow(
            -1.0,
            pressure,
            supply_pressure=robot.supply.pressure,
            ambient_pressure=ambient,
            conductance=muscle.valve.sonic_conductance,
            critical_ratio=muscle.valve.critical_ratio,
            temperature=temperature,
        )
        pressure += _STEP * pressure_rate(flow, pressure, volume, temperature=temperature)
        time += _STEP
    return time + 5.0 * muscle.valve.time_constant
