"""A joint with two muscles against each other on a pulley, whose pressures are two arguments.

With lengths L_a = L_a0 - r q and L_b = L_b0 + r q, torque = r (F_a - F_b) and, at constant
pressures, stiffness = -d torque/dq = r^2 (K_a + K_b). The two pressures are two degrees of freedom:
the difference of the pulls determines the torque, their sum the stiffness. `JointStatics` computes
all of it, for any number of muscles.
"""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.bounds import within
from pam_model.errors import DomainError
from pam_model.joints.joint_muscle import JointMuscle, JointPressures
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig.types import Rig
from pam_model.robot.compose import compose
from pam_model.robot.robot import Robot, RobotJoint

Pair = tuple[float, float]


class AntagonisticJoint:
    """Statics of one joint of two muscles, for plain floats.

    Parameters
    ----------
    agonist, antagonist : JointMuscle
        The agonist pulls towards positive positions.
    pulley_radius : float
        r [m].
    ambient_pressure : float, optional
        [Pa absolute].
    exponent : float, optional
        Polytropic exponent of shut chambers [-].

    Raises
    ------
    DomainError
        For a radius or pressure that is not above 0, or an exponent outside 1 to 1.4.
    """

    def __init__(
        self,
        agonist: JointMuscle,
        antagonist: JointMuscle,
        pulley_radius: float,
        *,
        ambient_pressure: float = 101325.0,
        exponent: float = 1.0,
    ) -> None:
        within("pulley_radius", pulley_radius, unit="m", above=0.0, error=DomainError)
        self.agonist, self.antagonist = agonist, antagonist
        self.pulley_radius = pulley_radius
        self.statics = JointStatics(
            (agonist, antagonist),
            (pulley_radius, -pulley_radius),
            ambient_pressure=ambient_pressure,
            exponent=exponent,
        )
        self.position_range = self.statics.position_range
        """Range of positions in the domain of both models [rad]."""

    @classmethod
    def from_robot(
        cls,
        robot: Robot,
        joint: RobotJoint,
        *,
        min_pressure: float = 0.0,
        pressure_share: float = 1.0,
    ) -> AntagonisticJoint:
        """A joint of a robot with two muscles on one pulley; as `JointStatics.from_robot`."""
        statics = JointStatics.from_robot(
            robot, joint, min_pressure=min_pressure, pressure_share=pressure_share
        )
        agonist, antagonist = statics.muscles
        return cls(
            agonist,
            antagonist,
            statics.radius,
            ambient_pressure=statics.ambient_pressure,
            exponent=statics.exponent,
        )

    @classmethod
    def from_rig(
        cls,
        rig: Rig,
        joint: str | int = 0,
        *,
        min_pressure: float = 0.0,
        pressure_share: float = 1.0,
    ) -> AntagonisticJoint:
        """The joint of the robot that a rig file describes; otherwise as `from_robot`.

        Parameters
        ----------
        rig : Rig
            As read from a file.
        joint : str or int
            Name or number of the joint.
        min_pressure, pressure_share : float, optional
            As for `from_robot`.

        Raises
        ------
        UnknownNameError
            For an unknown joint.
        DomainError
            If a muscle cannot reach `min_pressure`.
        """
        robot = compose(rig)
        return cls.from_robot(
            robot,
            robot.joints[rig.joint_number(joint)],
            min_pressure=min_pressure,
            pressure_share=pressure_share,
        )

    def lengths(self, position: float) -> Pair:
        """Agonist's and antagonist's length [m] at a position [rad]."""
        first, second = self.statics.lengths(position)
        return first, second

    def tensions(
        self, agonist: float, antagonist: float, position: float, velocity: float = 0.0
    ) -> Pair:
        """Pulls of agonist and antagonist [N], never below 0.

        Parameters
        ----------
        agonist, antagonist : float
            Pressures [Pa gauge].
        position, velocity : float
            Of the joint [rad], [rad/s].

        Raises
        ------
        DomainError
            If the position is outside the domain of a model.
        """
        first, second = self.statics.tensions((agonist, antagonist), position, velocity)
        return first, second

    def torque(
        self, agonist: float, antagonist: float, position: float, velocity: float = 0.0
    ) -> float:
        """Torque r (F_a - F_b) [N m]; arguments and errors as for `tensions`."""
        return self.statics.torque((agonist, antagonist), position, velocity)

    def torques(self, pressures: Sequence[Pair], position: float) -> list[float]:
        """Torques [N m] of several pairs of pressures at one position, at rest; see `tensions`."""
        return self.statics.torques(pressures, position)

    def stiffness(self, agonist: float, antagonist: float, position: float) -> float:
        """Stiffness at constant pressures [N m/rad]; a slack muscle adds nothing."""
        return self.statics.stiffness((agonist, antagonist), position)

    def closed_stiffness(self, agonist: float, antagonist: float, position: float) -> float:
        """Stiffness with both chambers shut [N m/rad]; a slack muscle adds nothing."""
        return self.statics.closed_stiffness((agonist, antagonist), position)

    def volumes(self, position: float) -> Pair:
        """Gas volumes [m^3], including dead volumes."""
        first, second = self.statics.volumes(position)
        return first, second

    def volume_slopes(self, position: float) -> Pair:
        """dV/dq of both muscles [m^3/rad]."""
        first, second = self.statics.volume_slopes(position)
        return first, second

    def pressures_for(self, torque: float, stiffness: float, position: float) -> JointPressures:
        """The pressures for a torque and a stiffness; as `JointStatics.pressures_for`."""
        return self.statics.pressures_for(torque, stiffness, position)
