"""What holds for one joint while it is controlled: the numbers and models of it, made once."""

from __future__ import annotations

from dataclasses import dataclass

from pam_control.compensation.dry_friction import JointFriction
from pam_control.joint_scale import JointScale
from pam_control.limited import limited
from pam_control.references.spline import JointReference
from pam_control.settings import ControlSettings
from pam_model.joints.joint_statics import JointStatics
from pam_model.robot import Robot, RobotJoint, RobotMuscle
from pam_model.views.inverse_dynamics import InverseDynamics
from pam_ros.valve_command import FLOW

PerMuscle = tuple[float, ...]
"""One number for each muscle of a joint, in the order of its arms."""

# Of max_pressure, above which the driver vents: pressure loops overshoot by 1 %, and noise adds.
PRESSURE_SHARE = 0.97


@dataclass(frozen=True, slots=True, eq=False)
class JointModels:
    """The models of one joint."""

    robot: Robot  # it belongs to this robot
    joint: RobotJoint  # its limits and its place among the joints
    model: JointStatics  # torque and stiffness of its muscles, and their inverse
    dynamics: InverseDynamics  # its equation of motion, without dry friction
    dry_friction: JointFriction  # as it is compensated
    muscles: tuple[RobotMuscle, ...]  # in the order of the arms of the joint
    scale: JointScale  # its size
    # of the pressure sensors [s]; well above the pressure loop's crossover it acts as a delay
    pressure_lag: float

    @classmethod
    def of(cls, robot: Robot, joint: RobotJoint, min_pressure: float) -> JointModels:
        """The models of a joint whose muscles have at least this pressure [Pa]."""
        model = JointStatics.from_robot(
            robot, joint, min_pressure=min_pressure, pressure_share=PRESSURE_SHARE
        )
        muscles = tuple(robot.muscles[place] for place in joint.muscles)
        return cls(
            robot,
            joint,
            model,
            InverseDynamics.from_joint(joint),
            JointFriction.from_joint(joint),
            muscles,
            JointScale.of(joint, model),
            max(muscle.pressure_lag for muscle in muscles),
        )

    @property
    def name(self) -> str:
        """Of the joint."""
        return self.joint.name

    @property
    def turn(self) -> float:
        """Place among the joints [-], so that not all of them learn in one control cycle."""
        return self.joint.place / len(self.robot.joints)

    @property
    def valve_time_constants(self) -> tuple[float, ...]:
        """Lags of the valves [s]."""
        return tuple(muscle.valve.time_constant for muscle in self.muscles)

    @property
    def command_delays(self) -> tuple[float, ...]:
        """Delays of the valves [s]."""
        return tuple(muscle.valve.command_delay for muscle in self.muscles)

    @property
    def position_delay(self) -> float:
        """Of the position sensor [s]."""
        return self.joint.position_delay

    def torque(self, reference: JointReference) -> float:
        """Torque [N m] for a reference, without dry friction."""
        return self.dynamics.torque(reference.position, reference.velocity, reference.acceleration)

    def inside(self, position: float) -> float:
        """The position [rad] limited to the range of the muscles' models."""
        low, high = self.model.position_range
        return limited(position, low, high)

    def acting_delays(self, settings: ControlSettings) -> PerMuscle:
        """Time from a control cycle until each valve acts, by the rig file [s].

        The lag of a flow valve is partly made up for by a lead, that of a regulator is not.
        """
        soon = settings.command_delay + 0.5 * settings.period
        return tuple(
            soon
            + (settings.lead_ratio if muscle.valve.kind == FLOW else 1.0)
            * muscle.valve.follows_after
            + muscle.valve.command_delay
            for muscle in self.muscles
        )
