"""The motion that the valves of a joint can drive, as a line of acceleration over speed.

Moving air costs time. With both valves fully open, one to the supply and one to ambient, the torque
of a joint changes at most with the rate R [N m/s] (ISO 6358 flow, polytropic chambers). A joint
that moves with the speed v needs R_v = K v to keep its torque, where K is its stiffness with shut
valves: the motion compresses the gas. What is left changes the torque, as in a motor whose torque
falls with its speed:

    v_valve = R/K,    a(v) = a_valve (1 - |v|/v_valve),    a_valve = R/(J w),    w = sqrt(K/J)

An acceleration a that begins suddenly lags by the time J a/(R - K v); within the line this time is
below 1/w, the time in which the joint itself answers a torque. A joint that brakes needs less air,
because the motion brakes it.

The line is computed where the joint is in the middle of its range with the given stiffness.
"""

from __future__ import annotations

import math

from pam_control.feedback.operating_points import operating_point
from pam_control.joint_channel import JointChannel
from pam_control.references.motion_limiter import MotionLimits
from pam_model.errors import PamError
from pam_model.gas import pressure_rate, valve_flow
from pam_model.rig import Muscle, Rig


def drivable_motion(rig: Rig, channel: JointChannel, stiffness: float) -> MotionLimits:
    """Speed and acceleration that the valves of a joint can drive; infinite if unknown.

    Parameters
    ----------
    rig : Rig
        Gas and supply.
    channel : JointChannel
        The joint.
    stiffness : float
        [N m/rad].
    """
    low, high = channel.joint.position_limits
    position = 0.5 * (low + high)
    torque = channel.dynamics.gravity(position)
    try:
        reached = channel.model.pressures_for(torque, stiffness, position)
        pressures = (reached.agonist, reached.antagonist)
        point = operating_point(channel.joint, channel.model, position, pressures)
    except PamError:  # the muscles cannot hold the joint there
        return MotionLimits(math.inf, math.inf)
    slopes = [abs(slope) for slope in point.torque_slopes]
    stiff = point.spring + sum(
        slope * abs(motion) for slope, motion in zip(slopes, point.motion_pressure, strict=True)
    )
    if not stiff > 0.0:
        return MotionLimits(math.inf, math.inf)
    filling, emptying = (
        [
            slope * _rate(rig, muscle, opening, pressure, volume)
            for slope, muscle, pressure, volume in zip(
                slopes, channel.muscles, pressures, channel.model.volumes(position), strict=True
            )
        ]
        for opening in (1.0, -1.0)
    )
    rate = min(filling[0] + emptying[1], filling[1] + emptying[0])
    return MotionLimits(rate / stiff, rate / math.sqrt(stiff * point.inertia))


def _rate(rig: Rig, muscle: Muscle, opening: float, pressure: float, volume: float) -> float:
    """How fast a fully open valve changes the pressure in a closed chamber [Pa/s]."""
    gas, inside = rig.gas, pressure + rig.gas.ambient_pressure
    flow = valve_flow(
        opening,
        inside,
        supply_pressure=rig.supply_pressure,
        ambient_pressure=gas.ambient_pressure,
        conductance=muscle.valve.sonic_conductance,
        critical_ratio=muscle.valve.critical_ratio,
        temperature=gas.temperature,
    )
    return abs(
        float(
            pressure_rate(
                flow, inside, volume, temperature=gas.temperature, exponent=gas.polytropic_exponent
            )
        )
    )
