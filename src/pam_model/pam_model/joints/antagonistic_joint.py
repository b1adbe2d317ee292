"""A joint with two muscles on a pulley: torque and stiffness from pressures, and the inverse.

With lengths L_a = L_a0 - r q and L_b = L_b0 + r q, torque = r (F_a - F_b) and, at constant
pressures, stiffness = -d torque/dq = r^2 (K_a + K_b). The two pressures are two degrees of freedom:
the difference of the pulls determines the torque, their sum the stiffness.

For models affine in pressure the inverse is exact: the torque is constant along a straight line in
the plane of the two pressures, and the stiffness is linear along this line. For other models the
line is iterated with secants through the last two points until it converges.

Source: section on antagonistic joints of "A Review of Design and Modeling of Pneumatic
Artificial Muscle".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pam_model.bounds import within
from pam_model.errors import DomainError
from pam_model.joints.affine_inverse import (
    Line,
    Point,
    affine_line,
    affine_pressures,
    antagonist_pull,
    is_limited,
    pressure_for,
    shifted,
    through,
)
from pam_model.joints.joint_muscle import JointMuscle, JointPressures
from pam_model.muscles.force_model import AffineForceModel
from pam_model.physics.joint_geometry import AGONIST_SIGN, ANTAGONIST_SIGN, muscle_length
from pam_model.rig.types import Rig
from pam_model.robot.compose import compose
from pam_model.robot.robot import Robot, RobotJoint

_EDGE = 1e-6
_ROUNDS = 20
_PRESSURE_TOLERANCE = 0.1


class AntagonisticJoint:
    """Statics of one joint, for plain floats.

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
        within("ambient_pressure", ambient_pressure, unit="Pa", above=0.0, error=DomainError)
        within("exponent", exponent, 1.0, 1.4, error=DomainError)
        self.agonist = agonist
        self.antagonist = antagonist
        self.pulley_radius = pulley_radius
        self.ambient_pressure = ambient_pressure
        self.exponent = exponent
        self._affine: tuple[AffineForceModel, AffineForceModel] | None = None
        if agonist.affine_model is not None and antagonist.affine_model is not None:
            self._affine = agonist.affine_model, antagonist.affine_model
        ends = []
        for muscle, sign in ((agonist, -1.0), (antagonist, 1.0)):
            low, high = muscle.model.length_bounds
            edge = _EDGE * (min(high, 10.0 * muscle.neutral_length) - low)
            ends.append(
                sorted(
                    sign * (length - muscle.neutral_length) / pulley_radius
                    for length in (low + edge, high - edge)
                )
            )
        self.position_range = (max(ends[0][0], ends[1][0]), min(ends[0][1], ends[1][1]))
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
        """A joint of a robot, with its static effects.

        Parameters
        ----------
        robot : Robot
            The robot.
        joint : RobotJoint
            One of its joints, with two muscles on one pulley.
        min_pressure : float, optional
            Lower limit of the commands [Pa gauge].
        pressure_share : float, optional
            Share of a muscle's `max_pressure` up to which it is commanded [-].

        Raises
        ------
        DomainError
            If a muscle cannot reach `min_pressure`.
        """
        muscles = []
        for arm in joint.arms:
            muscle = robot.muscles[arm.muscle]
            high = min(pressure_share * muscle.max_pressure, robot.supply_gauge_pressure)
            if not 0.0 <= min_pressure < high:
                raise DomainError(
                    f"min_pressure = {min_pressure:g} Pa must be from 0 to below {high:g} Pa, "
                    f"the most that {muscle.name} gets"
                )
            muscles.append(
                JointMuscle(
                    muscle.force_model,
                    muscle.neutral_length,
                    min_pressure,
                    high,
                    muscle.dead_volume,
                )
            )
        agonist, antagonist = muscles
        return cls(
            agonist,
            antagonist,
            joint.arms[0].length,
            ambient_pressure=robot.gas.ambient_pressure,
            exponent=robot.gas.polytropic_exponent,
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

    def lengths(self, position: float) -> tuple[float, float]:
        """Agonist's and antagonist's length [m] at a position [rad]."""
        radius = self.pulley_radius
        return (
            muscle_length(self.agonist.neutral_length, AGONIST_SIGN, radius, position),
            muscle_length(self.antagonist.neutral_length, ANTAGONIST_SIGN, radius, position),
        )

    def tensions(
        self, agonist: float, antagonist: float, position: float, velocity: float = 0.0
    ) -> tuple[float, float]:
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
        first, second = self.lengths(position)
        speed = self.pulley_radius * velocity
        return (
            max(0.0, float(self.agonist.model.force(agonist, first, -speed))),
            max(0.0, float(self.antagonist.model.force(antagonist, second, speed))),
        )

    def torque(
        self, agonist: float, antagonist: float, position: float, velocity: float = 0.0
    ) -> float:
        """Torque r (F_a - F_b) [N m]; arguments and errors as for `tensions`."""
        first, second = self.tensions(agonist, antagonist, position, velocity)
        return self.pulley_radius * (first - second)

    def torques(self, pressures: Sequence[tuple[float, float]], position: float) -> list[float]:
        """Torques [N m] of several pairs of pressures at one position, at rest; see `tensions`."""
        if self._affine is None:
            return [self.torque(*pair, position) for pair in pressures]
        first, second = self.lengths(position)
        scale_a, passive_a = self._affine[0].coefficients(first)
        scale_b, passive_b = self._affine[1].coefficients(second)
        return [
            self.pulley_radius
            * (max(0.0, a * scale_a + passive_a) - max(0.0, b * scale_b + passive_b))
            for a, b in pressures
        ]

    def stiffness(self, agonist: float, antagonist: float, position: float) -> float:
        """Stiffness at constant pressures [N m/rad]; a slack muscle adds nothing."""
        return self._stiffness(
            agonist,
            antagonist,
            position,
            lambda muscle, pressure, length: float(muscle.model.stiffness(pressure, length)),
        )

    def closed_stiffness(self, agonist: float, antagonist: float, position: float) -> float:
        """Stiffness with both chambers shut [N m/rad]; a slack muscle adds nothing."""
        return self._stiffness(
            agonist,
            antagonist,
            position,
            lambda muscle, pressure, length: float(
                muscle.model.closed_stiffness(
                    pressure,
                    length,
                    dead_volume=muscle.dead_volume,
                    ambient_pressure=self.ambient_pressure,
                    exponent=self.exponent,
                )
            ),
        )

    def _stiffness(
        self,
        agonist: float,
        antagonist: float,
        position: float,
        rate: Callable[[JointMuscle, float, float], float],
    ) -> float:
        first, second = self.lengths(position)
        total = 0.0
        for muscle, pressure, length in (
            (self.agonist, agonist, first),
            (self.antagonist, antagonist, second),
        ):
            if float(muscle.model.force(pressure, length)) > 0.0:
                total += rate(muscle, pressure, length)
        return self.pulley_radius * self.pulley_radius * total

    def volumes(self, position: float) -> tuple[float, float]:
        """Gas volumes [m^3], including dead volumes."""
        first, second = self.lengths(position)
        return (
            float(self.agonist.model.volume(first)) + self.agonist.dead_volume,
            float(self.antagonist.model.volume(second)) + self.antagonist.dead_volume,
        )

    def volume_slopes(self, position: float) -> tuple[float, float]:
        """dV/dq of both muscles [m^3/rad]."""
        first, second = self.lengths(position)
        return (
            -self.pulley_radius * float(self.agonist.model.volume_slope(first)),
            self.pulley_radius * float(self.antagonist.model.volume_slope(second)),
        )

    def pressures_for(self, torque: float, stiffness: float, position: float) -> JointPressures:
        """The pressures for a torque and a stiffness at constant pressures.

        The request is limited to the range of the pressures: first the torque to its reachable
        range, then the stiffness to the range that is reachable at this torque.

        Parameters
        ----------
        torque : float
            [N m].
        stiffness : float
            [N m/rad].
        position : float
            [rad]; outside `position_range` the nearest limit is used.

        Raises
        ------
        DomainError
            If a request is not finite.
        """
        if not (math.isfinite(torque) and math.isfinite(stiffness) and math.isfinite(position)):
            raise DomainError(
                f"torque = {torque} N m, stiffness = {stiffness} N m/rad, position = {position} "
                "rad: all must be finite numbers"
            )
        low, high = self.position_range
        inside = low if position < low else min(position, high)
        first, second = self.lengths(inside)
        a, b = self._line(self.agonist, first), self._line(self.antagonist, second)
        radius = self.pulley_radius
        first_pressure, second_pressure, reached, stiff, cut, soft = affine_pressures(
            a, b, radius, torque, stiffness
        )
        if self._affine is None:
            difference = min(max(torque / radius, a[0] - b[1]), a[1] - b[0])
            rate = stiffness / (radius * radius)
            first_pressure, second_pressure = self._refine(a, b, (first, second), difference, rate)
            reached = self.torque(first_pressure, second_pressure, inside)
            stiff = self.stiffness(first_pressure, second_pressure, inside)
            cut, soft = is_limited(a, b, radius, reached - torque, stiff - stiffness, stiffness)
        return JointPressures(
            agonist=first_pressure,
            antagonist=second_pressure,
            torque=reached,
            stiffness=stiff,
            torque_limited=cut,
            stiffness_limited=soft,
            position_limited=inside != position,
        )

    @staticmethod
    def _line(muscle: JointMuscle, length: float) -> Line:
        model, low, high = muscle.model, muscle.low_pressure, muscle.high_pressure
        affine = muscle.affine_model
        if affine is not None:
            scale, passive = affine.coefficients(length)
            return affine_line(scale, passive, *affine.coefficient_slopes(length), low, high)
        ends = [
            (each, float(model.force(each, length)), float(model.stiffness(each, length)))
            for each in (low, high)
        ]
        weakest, strongest = (max(0.0, pull) for _, pull, _ in ends)
        if strongest <= weakest:
            # The muscle is too short to pull at any pressure, so the choice has no influence.
            rate = ends[0][2] if weakest > 0.0 else 0.0
            return weakest, weakest, 0.0, weakest, 0.0, rate, low, high
        return through((weakest, strongest, 0.0, 0.0, 0.0, 0.0, low, high), *ends)

    def _refine(
        self,
        a: Line,
        b: Line,
        lengths: tuple[float, float],
        difference: float,
        rate: float,
    ) -> list[float]:
        """Pressures for models that are not affine: iterate both lines until they converge."""
        lines, muscles = [a, b], (self.agonist, self.antagonist)
        last: list[Point | None] = [None, None]
        pressures = [a[6], b[6]]
        for _ in range(_ROUNDS):
            pull = antagonist_pull(lines[0], lines[1], difference, rate)
            step = 0.0
            for index, (muscle, length) in enumerate(zip(muscles, lengths, strict=True)):
                line, before = lines[index], last[index]
                pressure = pressure_for(line, pull + difference if index == 0 else pull)
                point = (
                    pressure,
                    float(muscle.model.force(pressure, length)),
                    float(muscle.model.stiffness(pressure, length)),
                )
                moved = math.inf if before is None else abs(pressure - before[0])
                step = max(step, moved)
                if before is None or moved <= _PRESSURE_TOLERANCE:
                    lines[index] = shifted(line, point)
                else:
                    lines[index] = through(line, before, point)
                last[index], pressures[index] = point, pressure
            if step < _PRESSURE_TOLERANCE:
                break
        return pressures
