"""The motion that the valves of a joint can drive, as a line of acceleration over speed.

Moving air costs time. A fully open valve changes the pressure of its muscle with a limited rate r
(ISO 6358 flow, polytropic chamber). At constant stiffness, a torque needs the pressure p_t per
torque, and an angle p_q per angle; a motion also compresses the gas by c per angle, which the valve
has to make up for. With the stiffness K of joint and shut valves, and the inertia J, for the valve
for which they are smallest:

    v_valve = r/|p_q + c|,    a_valve = r/(|p_t| J w),    w = sqrt(K/J)

v_valve is the speed that the valves can keep up. An acceleration up to a_valve that begins suddenly
lags by less than 1/w, the time in which the joint itself answers a torque. A joint that moves needs
air for its motion. As in a motor whose torque falls with its speed, a_valve (1 - |v|/v_valve) is
left to make it faster, and a_valve (1 + |v|/v_valve) to make it slower.

Both are computed with the given stiffness at the ends and in the middle of the joint's range.
"""

from __future__ import annotations

import math

from pam_control.feedback.operating_points import POSITION_SHARES, operating_point
from pam_control.joint_channel import JointChannel
from pam_model.errors import PamError
from pam_model.gas import pressure_rate, valve_flow
from pam_model.rig import Muscle, Rig


def drivable_motion(rig: Rig, channel: JointChannel, stiffness: float) -> tuple[float, float]:
    """Acceleration [rad/s^2] and speed [rad/s] that the valves of a joint can drive.

    Parameters
    ----------
    rig : Rig
        Gas and supply.
    channel : JointChannel
        The joint.
    stiffness : float
        [N m/rad].

    Returns
    -------
    acceleration, velocity : float
        Infinite where the muscles cannot hold the joint, so that nothing is known.
    """
    low, high = channel.joint.position_limits
    found = []
    for share in POSITION_SHARES:
        try:
            found.append(_drivable_at(rig, channel, stiffness, low + share * (high - low)))
        except PamError:  # the muscles cannot hold the joint there
            continue
    return (
        min((acceleration for acceleration, _ in found), default=math.inf),
        min((velocity for _, velocity in found), default=math.inf),
    )


def _drivable_at(
    rig: Rig, channel: JointChannel, stiffness: float, position: float
) -> tuple[float, float]:
    reached = channel.model.pressures_for(channel.dynamics.gravity(position), stiffness, position)
    pressures = (reached.agonist, reached.antagonist)
    point = operating_point(channel.joint, channel.model, position, pressures)
    gravity = channel.dynamics.gravity_stiffness(position)
    springs = zip(point.torque_slopes, point.motion_pressure, strict=True)
    stiff = point.spring + sum(abs(slope * motion) for slope, motion in springs)
    acceleration = velocity = math.inf
    for muscle, pressure, volume, per_position, per_torque, motion in zip(
        channel.muscles,
        pressures,
        channel.model.volumes(position),
        point.per_position,
        point.per_torque,
        point.motion_pressure,
        strict=True,
    ):
        filling, emptying = (_rate(rig, muscle, u, pressure, volume) for u in (1.0, -1.0))
        rate = min(filling, emptying)  # in one direction of motion or in the other
        velocity = min(velocity, rate / abs(per_position + gravity * per_torque + motion))
        if stiff > 0.0:
            lag = math.sqrt(stiff * point.inertia)
            acceleration = min(acceleration, rate / (abs(per_torque) * lag))
    return acceleration, velocity


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
