"""A robot as URDF, for robot_state_publisher, RViz and simulators that know rigid bodies only.

The link of a joint is its equivalent rod (equivalent_rod.py). Every joint hangs on `base_link`,
since the rig file does not say how joints are chained: edit the origins.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from pam_model.effects.slots import JointTorque
from pam_model.robot.robot import Robot, RobotJoint
from pam_model.views.equivalent_rod import BALANCED_LENGTH, EquivalentRod
from pam_model.views.torque_balance import dry_friction_at_rest
from pam_model.views.torque_range import largest_torque


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{number + 0.0:.9g}" for number in numbers)


def _add_link(document: ET.Element, joint: RobotJoint) -> None:
    rod = EquivalentRod.of(joint)
    centre = _text(rod.centre * part for part in rod.down)
    link = ET.SubElement(document, "link", name=f"{joint.name}_link")
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=centre, rpy=_text((0.0, rod.pitch, 0.0)))
    ET.SubElement(inertial, "mass", value=_text((rod.mass,)))
    across, along = rod.inertia_across, rod.inertia_along
    products = {"ixy": "0", "ixz": "0", "iyz": "0"}
    moments = {"ixx": _text((across,)), "iyy": _text((across,)), "izz": _text((along,))}
    ET.SubElement(inertial, "inertia", moments | products)
    for part in ("visual", "collision"):
        shown = ET.SubElement(link, part)
        ET.SubElement(shown, "origin", xyz=centre, rpy=_text((0.0, rod.pitch, 0.0)))
        geometry = ET.SubElement(shown, "geometry")
        ET.SubElement(
            geometry, "cylinder", radius=_text((rod.radius,)), length=_text((rod.length,))
        )


def _add_joint(document: ET.Element, robot: Robot, joint: RobotJoint) -> None:
    made = ET.SubElement(document, "joint", name=joint.name, type="revolute")
    ET.SubElement(made, "parent", link="base_link")
    ET.SubElement(made, "child", link=f"{joint.name}_link")
    ET.SubElement(made, "origin", xyz=_text((0.0, BALANCED_LENGTH * joint.place, 0.0)), rpy="0 0 0")
    ET.SubElement(made, "axis", xyz="0 1 0")
    lower, upper = (_text((limit,)) for limit in joint.position_limits)
    ET.SubElement(
        made,
        "limit",
        lower=lower,
        upper=upper,
        velocity=_text((joint.max_velocity,)),
        effort=_text((largest_torque(robot, joint),)),
    )
    ET.SubElement(
        made,
        "dynamics",
        damping=_text((joint.viscous_friction,)),
        friction=_text((dry_friction_at_rest(joint),)),
    )
    left_out = sorted({effect.name for effect, _, _ in joint.laws(JointTorque)})
    if left_out:
        made.append(ET.Comment(f" not in URDF: {', '.join(left_out)} "))


def robot_as_urdf(robot: Robot, name: str) -> str:
    """A robot as a URDF document.

    Inertia, damping, dry friction and gravity are those that hold with the effects of the rig file;
    joint names, limits and speed limit are those of the rig file. The torque limit is the largest
    torque of one muscle. Positions are in rad about the y axis. A comment names the torques of
    joints that URDF cannot state.

    Parameters
    ----------
    robot : Robot
        The robot; bench muscles without a joint are left out.

    Raises
    ------
    DomainError
        If the force models do not cover the joint's range.
    """
    document = ET.Element("robot", name=name)
    ET.SubElement(document, "link", name="base_link")
    for joint in robot.joints:
        _add_link(document, joint)
        _add_joint(document, robot, joint)
    ET.indent(document)
    return '<?xml version="1.0"?>\n' + ET.tostring(document, encoding="unicode") + "\n"
