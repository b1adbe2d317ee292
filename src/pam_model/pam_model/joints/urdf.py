"""A rig as URDF, for robot_state_publisher, RViz and simulators that know rigid bodies only.

The rig file describes each joint by its inertia and gravity torque, not by the shape of its link.
The link is therefore the uniform rod that has exactly these two (I = m L^2 / 3,
gravity_torque = m g L / 2), or a rod about its centre if there is no gravity torque. Every joint
hangs on `base_link`, since the rig file does not say how joints are chained: edit the origins.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.rig.types import Joint, Rig

STANDARD_GRAVITY = 9.80665  # m/s^2
_BALANCED_LENGTH = 0.2  # m, of a rod whose length follows from nothing
_SLENDER = 0.05  # diameter over length of the drawn rod
_POSITIONS = 41


@dataclass(frozen=True, slots=True)
class EquivalentRod:
    """The uniform slender rod with a joint's inertia and gravity torque.

    Attributes
    ----------
    mass : float
        [kg].
    length : float
        [m].
    centre : float
        Distance of its centre from the joint's axis [m]; 0 or half of the length.
    """

    mass: float
    length: float
    centre: float

    @classmethod
    def of(cls, joint: Joint) -> EquivalentRod:
        """The rod of a joint."""
        if joint.gravity_torque == 0.0:
            length = _BALANCED_LENGTH
            return cls(12.0 * joint.inertia / length**2, length, 0.0)
        gravity = abs(joint.gravity_torque)
        length = 1.5 * joint.inertia * STANDARD_GRAVITY / gravity
        return cls(2.0 * gravity / (STANDARD_GRAVITY * length), length, 0.5 * length)

    @property
    def inertia_about_centre(self) -> float:
        """M L^2 / 12 [kg m^2]."""
        return self.mass * self.length**2 / 12.0


def largest_torque(rig: Rig, joint: Joint) -> float:
    """Largest torque of one muscle at its highest pressure within the joint's limits [N m]."""
    pair = AntagonisticJoint.from_rig(rig, joint.name)
    agonist, antagonist = (rig.muscle(name).max_pressure for name in joint.muscles)
    torques = [
        abs(pair.torque(*pressures, float(position)))
        for position in np.linspace(*joint.position_limits, _POSITIONS)
        for pressures in ((agonist, 0.0), (0.0, antagonist))
    ]
    return max(torques)


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{number + 0.0:.9g}" for number in numbers)


def _add_link(robot: ET.Element, joint: Joint) -> None:
    rod = EquivalentRod.of(joint)
    # With gravity_torque > 0 the rod hangs straight down at the position gravity_angle.
    pitch = -joint.gravity_angle + (math.pi if joint.gravity_torque < 0.0 else 0.0)
    down = (-math.sin(pitch), 0.0, -math.cos(pitch))
    centre = _text(rod.centre * part for part in down)
    radius = 0.5 * _SLENDER * rod.length
    link = ET.SubElement(robot, "link", name=f"{joint.name}_link")
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=centre, rpy=_text((0.0, pitch, 0.0)))
    ET.SubElement(inertial, "mass", value=_text((rod.mass,)))
    across, along = rod.inertia_about_centre, 0.5 * rod.mass * radius**2
    products = {"ixy": "0", "ixz": "0", "iyz": "0"}
    moments = {"ixx": _text((across,)), "iyy": _text((across,)), "izz": _text((along,))}
    ET.SubElement(inertial, "inertia", moments | products)
    for part in ("visual", "collision"):
        shown = ET.SubElement(link, part)
        ET.SubElement(shown, "origin", xyz=centre, rpy=_text((0.0, pitch, 0.0)))
        geometry = ET.SubElement(shown, "geometry")
        ET.SubElement(geometry, "cylinder", radius=_text((radius,)), length=_text((rod.length,)))


def _add_joint(robot: ET.Element, rig: Rig, joint: Joint, place: int) -> None:
    made = ET.SubElement(robot, "joint", name=joint.name, type="revolute")
    ET.SubElement(made, "parent", link="base_link")
    ET.SubElement(made, "child", link=f"{joint.name}_link")
    ET.SubElement(made, "origin", xyz=_text((0.0, _BALANCED_LENGTH * place, 0.0)), rpy="0 0 0")
    ET.SubElement(made, "axis", xyz="0 1 0")
    lower, upper = (_text((limit,)) for limit in joint.position_limits)
    ET.SubElement(
        made,
        "limit",
        lower=lower,
        upper=upper,
        velocity=_text((joint.max_velocity,)),
        effort=_text((largest_torque(rig, joint),)),
    )
    ET.SubElement(made, "dynamics", damping=_text((joint.viscous_friction,)), friction="0")


def rig_as_urdf(rig: Rig, name: str) -> str:
    """The rig as a URDF document.

    Joint names, limits, speed limit, inertia, damping and gravity are those of the rig file; the
    torque limit is the largest torque of one muscle. Positions are in rad about the y axis.

    Parameters
    ----------
    rig : Rig
        The rig; bench muscles without a joint are left out.
    name : str
        Name of the robot.

    Raises
    ------
    DomainError
        If the force models do not cover the joint's range.
    """
    robot = ET.Element("robot", name=name)
    ET.SubElement(robot, "link", name="base_link")
    for place, joint in enumerate(rig.joints):
        _add_link(robot, joint)
        _add_joint(robot, rig, joint, place)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"
