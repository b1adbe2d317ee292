"""The quantities of a robot by which the size of an effect is measured."""

from __future__ import annotations

import math
from typing import Final

from pam_model.effects import RigScales
from pam_model.plant.force_table import closed_form
from pam_model.robot.robot import Robot, RobotJoint

PRESSURE_SHARE: Final = 0.4  # of the supply's gauge pressure
LEAST_STROKE: Final = 0.02  # of the rest length
LEAST_AREA: Final = 1e-6  # m^2


def effect_scales(robot: Robot, joint: RobotJoint) -> RigScales:
    """The quantities of a joint and of its first muscle, a cylinder of braid."""
    arm = joint.arms[0]
    muscle = robot.muscles[arm.muscle]
    braid, length = muscle.geometry, muscle.neutral_length
    per_turns = 4.0 * math.pi * braid.turns**2
    area = max(abs((3.0 * length**2 - braid.thread_length**2) / per_turns), LEAST_AREA)
    pressure = PRESSURE_SHARE * robot.supply_gauge_pressure
    muscles = [robot.muscles[place] for place in joint.muscles]
    forms = [closed_form(each.model, each.geometry, dict(each.constants)) for each in muscles]
    return RigScales(
        flow=muscle.valve.sonic_conductance,
        volume=length * (braid.thread_length**2 - length**2) / per_turns + muscle.dead_volume,
        force=area * pressure,
        torque=abs(arm.length) * area * pressure,
        stroke=max(abs(braid.rest_length - length), LEAST_STROKE * braid.rest_length),
        pressure=pressure,
        reach=pressure * length,
        viscous_friction=joint.viscous_friction,
        gravity_torque=joint.gravity_torque,
        contraction_factor=max(1.0 if form is None else form[1] for form in forms),
        is_regulated=all(each.valve.kind == "pressure_regulator" for each in muscles),
    )
