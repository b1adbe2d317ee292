"""The speed to which a valve that is stuck open drives a held joint, whatever the driver does.

The joint is held away from where it hangs; one valve opens fully to the supply and stays open. The
driver may let air out, never in. The most that it can do is to shut the valve of the other muscle,
which then brakes the joint. Here the nominal plant tells how fast the joint becomes although this
happens in the very moment of the fault, without the time that recognising it takes. Only a smaller
valve, or one that shuts off the supply, makes the joint slower.
"""

from __future__ import annotations

from typing import Final

from pam_control.joint_models import JointModels
from pam_control.settings import ControlSettings
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.gravity import gravity_torque

HELD_ANGLE: Final = 0.8  # rad; joints are held at most so far away
RECOGNISED: Final = 1.1
"""A driver that first has to recognise the fault may be faster by this factor."""
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
    robot, ideal = compose(rig), compose(rig.without_effects())
    joint = ideal.joints[0]
    stiffness = (
        JointModels.of(robot, robot.joints[0], ControlSettings().min_pressure)
        .scale.complete(ControlSettings())
        .default_stiffness
    )
    pair = AntagonisticJoint.from_robot(ideal, joint)
    parameters = PlantParameters.from_rig(ideal.rig)
    fastest = 0.0
    for angle in (-held_at, held_at):
        held = pair.pressures_for(-gravity_torque(joint, angle), stiffness, angle)
        pressures = (held.agonist, held.antagonist)
        for commands in ((1.0, 0.0), (0.0, 1.0)):
            plant = Plant(
                parameters, state=initial_state(parameters, position=angle, pressures=pressures)
            )
            before = angle
            for _ in range(_STEPS):
                position = plant.step(commands, _STEP)[0]
                fastest = max(fastest, abs(position - before) / _STEP)
                before = position
    return fastest
