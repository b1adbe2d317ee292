"""The speeds to which air drives a joint although the driver does all that it may.

A valve that is stuck open fills its muscle from the supply. The driver may let air out, never in:
the most that it can do is to shut the valve of the other muscle, which then brakes the joint. A
muscle that bursts leaves the other one alone with its air: the most that the driver can do is to
let that out, too. Here the nominal plant says how fast a held joint becomes if the driver does so
in the very moment of the fault, without the time that recognising it takes. Only a smaller valve, a
lower pressure, or a valve that shuts off the supply makes the joint slower.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pam_control.joint_models import JointModels
from pam_control.settings import ControlSettings
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.gravity import gravity_torque

HELD_ANGLE: Final = 0.8  # rad; joints are held at most so far away
RECOGNISED: Final = 1.1
"""A driver that first has to recognise a stuck valve may be faster by this factor."""
_STEP: Final = 1e-3  # s
_STEPS: Final = 600


def stuck_valve_speed(rig: Rig, held_at: float = HELD_ANGLE) -> float:
    """The largest speed of the first joint with one valve stuck open, the other one shut [rad/s].

    Parameters
    ----------
    rig : Rig
        The joint is held with the default stiffness of the controller.
    held_at : float, optional
        How far from the middle, either way [rad].
    """
    return max(
        _fastest(rig, angle, commands, {})
        for angle in (-held_at, held_at)
        for commands in ((1.0, 0.0), (0.0, 1.0))
    )


def burst_speed(rig: Rig, conductance: float, held_at: float = HELD_ANGLE) -> float:
    """The largest speed of the first joint with a hole in one muscle, both valves vented [rad/s].

    Parameters
    ----------
    rig : Rig
        The joint is held with the default stiffness of the controller.
    conductance : float
        Sonic conductance of the hole [m^3/(s Pa)].
    held_at : float, optional
        How far from the middle, either way [rad].
    """
    return max(
        _fastest(rig, angle, (-1.0, -1.0), {f"{side}.leakage.conductance": conductance})
        for angle in (-held_at, held_at)
        for side in ("agonist", "antagonist")
    )


def _fastest(
    rig: Rig, angle: float, commands: tuple[float, float], changes: Mapping[str, float]
) -> float:
    robot, ideal = compose(rig), compose(rig.without_effects())
    joint = ideal.joints[0]
    stiffness = (
        JointModels.of(robot, robot.joints[0], ControlSettings().min_pressure)
        .scale.complete(ControlSettings())
        .default_stiffness
    )
    pair = JointStatics.from_robot(ideal, joint)
    held = pair.pressures_for(-gravity_torque(joint, angle), stiffness, angle)
    parameters = PlantParameters.from_rig(ideal.rig).forced(changes)
    pressures = held.pressures
    plant = Plant(parameters, state=initial_state(parameters, position=angle, pressures=pressures))
    before, fastest = angle, 0.0
    for _ in range(_STEPS):
        position = plant.step(commands, _STEP)[0]
        fastest = max(fastest, abs(position - before) / _STEP)
        before = position
    return fastest
