"""A robot as MJCF, the format of MuJoCo: links, friction, damping, limits, and muscles that pull.

A muscle is a general actuator on a fixed tendon, with the gauge pressure P in the muscle as its
control. MuJoCo's actuators are affine in the length l of their tendon, so the pull is
P (g0 + g1 l) + b0 + b1 l, fitted to the force model over the travel of its joints; a comment
states the largest error. A muscle does not push. Gas, valves and sensors have no place in MJCF.

Todorov, Erez, Tassa: MuJoCo, a physics engine for model-based control, IROS 2012; the format:
https://mujoco.readthedocs.io/en/stable/XMLreference.html.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pam_model.effects.slots import DryFriction, JointTorque, PullState
from pam_model.robot.robot import Robot, RobotJoint, RobotMuscle
from pam_model.views.equivalent_rod import BALANCED_LENGTH, STANDARD_GRAVITY, EquivalentRod
from pam_model.views.muscle_path import lengths_over_travel
from pam_model.views.torque_balance import dry_friction_at_rest

_PRESSURES = 9
_PLACES = 21
_TIME_STEP = 5e-4  # s
# Friction and end stops are soft in MuJoCo; these are as stiff as the time step permits.
_STIFF = {"solreffriction": "0.001 1", "solimpfriction": "0.999 0.9999 0.001 0.5 2",
          "solreflimit": "0.004 1", "solimplimit": "0.99 0.999 0.001 0.5 2"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class AffinePull:
    """The pull P (gain[0] + gain[1] l) + bias[0] + bias[1] l of a muscle.

    l is the path's length minus that at position 0 of all joints [m].
    """

    gain: tuple[float, float]  # [N/Pa], [N/(Pa m)]
    bias: tuple[float, float]  # [N], [N/m]
    error: float  # largest difference from the force model, as a share of its largest pull [-]

    @classmethod
    def of(cls, robot: Robot, muscle: RobotMuscle) -> AffinePull:
        """Fit it by least squares; DomainError where the force model is not defined."""
        lengths = np.unique(lengths_over_travel(robot, muscle, _PLACES))
        pressures = np.linspace(0.0, muscle.max_pressure, _PRESSURES)
        model, stroke = muscle.force_model, lengths - muscle.neutral_length
        force = np.array(
            [[float(model.force(float(p), float(at))) for at in lengths] for p in pressures]
        )
        # The vented muscle first: a motion without air is then as good as its bias.
        line = np.stack([np.ones_like(stroke), stroke], axis=1)
        bias = np.linalg.lstsq(line, force[0], rcond=None)[0]
        share = pressures / muscle.max_pressure
        columns = (share[1:, None, None] * line).reshape(-1, 2)
        gain = np.linalg.lstsq(columns, (force[1:] - line @ bias).ravel(), rcond=None)[0]
        wrong = np.maximum(np.outer(share, line @ gain) + line @ bias, 0.0) - np.maximum(force, 0.0)
        largest = float(force.max())
        error = float(np.abs(wrong).max()) / largest if largest > 0.0 else 0.0
        g0, g1 = (gain / muscle.max_pressure).tolist()
        b0, b1 = bias.tolist()
        return cls((g0, g1), (b0, b1), error)


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{number + 0.0:.9g}" for number in numbers)


def _add_body(world: ET.Element, joint: RobotJoint) -> None:
    rod = EquivalentRod.of(joint)
    body = ET.SubElement(
        world, "body", name=f"{joint.name}_link", pos=_text((0.0, BALANCED_LENGTH * joint.place, 0))
    )
    motion = {
        "name": joint.name,
        "axis": "0 1 0",
        "range": _text(joint.position_limits),
        "damping": _text((joint.viscous_friction,)),
        "frictionloss": _text((dry_friction_at_rest(joint),)),
    }
    ET.SubElement(body, "joint", motion | _STIFF)
    centre = _text(rod.centre * part for part in rod.down)
    across, along = rod.inertia_across, rod.inertia_along
    ET.SubElement(
        body, "inertial", pos=centre, euler=_text((0.0, rod.pitch, 0.0)), mass=_text((rod.mass,)),
        diaginertia=_text((across, across, along)),
    )  # fmt: skip
    ET.SubElement(
        body, "geom", type="cylinder", pos=centre, euler=_text((0.0, rod.pitch, 0.0)),
        size=_text((rod.radius, 0.5 * rod.length)), contype="0", conaffinity="0",
    )  # fmt: skip
    left_out = _left_out(joint.laws(JointTorque))
    if any(slot.law(joint.max_velocity, *values) != slot.law(0.0, *values)
           for _, slot, values in joint.laws(DryFriction)):  # fmt: skip
        left_out += ["dry friction that falls with the speed (that at rest is written)"]
    if left_out:
        body.append(ET.Comment(f" not in MJCF: {', '.join(left_out)} "))


def _left_out(laws: Sequence[tuple[object, ...]]) -> list[str]:
    return sorted({getattr(effect, "name", "") for effect, *_ in laws})


def _add_muscle(
    robot: Robot, muscle: RobotMuscle, tendons: ET.Element, actuators: ET.Element
) -> None:
    tendon = ET.SubElement(tendons, "fixed", name=f"{muscle.name}_path")
    for arm in muscle.arms:
        ET.SubElement(
            tendon, "joint", joint=robot.joints[arm.joint].name, coef=_text((-arm.length,))
        )
    pull = AffinePull.of(robot, muscle)
    # MuJoCo's force lengthens the tendon.
    ET.SubElement(
        actuators, "general", name=muscle.name, tendon=f"{muscle.name}_path",
        ctrlrange=_text((0.0, muscle.max_pressure)), forcelimited="true", forcerange="-1e6 0",
        gaintype="affine", gainprm=_text((-pull.gain[0], -pull.gain[1], 0.0)),
        biastype="affine", biasprm=_text((-pull.bias[0], -pull.bias[1], 0.0)),
    )  # fmt: skip
    about = f" {muscle.name}: control [Pa gauge]; pull within {100.0 * pull.error:.2g} %"
    left_out = _left_out(muscle.laws(PullState))
    if left_out:
        about += f"; not in MJCF: {', '.join(left_out)}"
    actuators.append(ET.Comment(f"{about} "))


def robot_as_mjcf(robot: Robot, name: str) -> str:
    """A robot as an MJCF document.

    Inertia, damping, dry friction, gravity and the static force of the muscles are those that hold
    with the effects of the rig file. Positions are in rad about the y axis. Comments name the
    effects that MJCF cannot state.

    Parameters
    ----------
    robot : Robot
        The robot; bench muscles without a joint are left out.
    name : str
        Name of the model.

    Raises
    ------
    DomainError
        If the force models do not cover the travel of the joints.
    """
    document = ET.Element("mujoco", model=name)
    ET.SubElement(document, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        document, "option", timestep=_text((_TIME_STEP,)), gravity=_text((0, 0, -STANDARD_GRAVITY))
    )
    document.append(
        ET.Comment(" MJCF has no gas, valves, sensors or delays: give the pressures yourself ")
    )
    world = ET.SubElement(document, "worldbody")
    for joint in robot.joints:
        _add_body(world, joint)
    tendons, actuators = ET.SubElement(document, "tendon"), ET.SubElement(document, "actuator")
    for muscle in robot.muscles:
        if muscle.arms:
            _add_muscle(robot, muscle, tendons, actuators)
    ET.indent(document)
    return '<?xml version="1.0"?>\n' + ET.tostring(document, encoding="unicode") + "\n"
