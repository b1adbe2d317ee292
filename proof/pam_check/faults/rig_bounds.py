"""What a trial of the campaign may do at most, from the limits in the rig file.

None of these numbers is measured: they follow from the largest pressures, the valves, the muscle
models and the limits of the joints. The campaign compares every trial with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pam_driver.driver_settings import DriverSettings
from pam_model.gas import pressure_rate, valve_flow
from pam_model.rig import Joint, Muscle, Rig

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
    margin, supply = DriverSettings().over_pressure_margin, rig.supply_gauge_pressure
    sides = [
        (joint, rig.muscle(name), sign)
        for joint in rig.joints
        for name, sign in zip(joint.muscles, (-1.0, 1.0), strict=True)
    ]
    low, high = rig.joints[0].position_limits
    stop = rig.plausibility.position_margin
    return RigBounds(
        exhaust_time=max(_exhaust_time(rig, *side) for side in sides),
        pressure=max(muscle.max_pressure for muscle in rig.muscles) + margin,
        force=max(_largest_force(rig, *side, side[1].max_pressure + margin) for side in sides),
        filled_pressure=max(*(muscle.max_pressure for muscle in rig.muscles), supply) + margin,
        filled_force=max(
            _largest_force(rig, *side, max(side[1].max_pressure, supply) + margin) for side in sides
        ),
        heavy=all(
            abs(joint.gravity_torque)
            > joint.pulley_radius * _largest_force(rig, joint, muscle, sign, EMPTY)
            for joint, muscle, sign in sides
        ),
        speed=min(joint.max_velocity for joint in rig.joints),
        tracking_error=min(joint.max_tracking_error for joint in rig.joints),
        position=(low - stop, high + stop),
    )


def _lengths(joint: Joint, muscle: Muscle, sign: float) -> list[float]:
    angles = np.linspace(*joint.position_limits, _LENGTHS)
    return [muscle.neutral_length + sign * joint.pulley_radius * float(q) for q in angles]


def _largest_force(rig: Rig, joint: Joint, muscle: Muscle, sign: float, pressure: float) -> float:
    model = rig.force_model(muscle.name)
    return max(float(model.force(pressure, length)) for length in _lengths(joint, muscle, sign))


def _exhaust_time(rig: Rig, joint: Joint, muscle: Muscle, sign: float) -> float:
    model = rig.force_model(muscle.name)
    lengths = _lengths(joint, muscle, sign)
    volume = max(float(model.volume(length)) for length in lengths) + muscle.dead_volume
    ambient, temperature = rig.gas.ambient_pressure, rig.gas.temperature
    pressure, time = ambient + muscle.max_pressure, 0.0
    while pressure > ambient + EMPTY and time < _NEVER:
        flow = valve_flow(
            -1.0,
            pressure,
            supply_pressure=rig.supply_pressure,
            ambient_pressure=ambient,
            conductance=muscle.valve.sonic_conductance,
            critical_ratio=muscle.valve.critical_ratio,
            temperature=temperature,
        )
        pressure += _STEP * pressure_rate(flow, pressure, volume, temperature=temperature)
        time += _STEP
    return time + 5.0 * muscle.valve.time_constant
