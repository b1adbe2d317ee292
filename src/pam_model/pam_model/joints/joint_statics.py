"""A joint and its muscles at rest: torque and stiffness from pressures, and the inverse.

With the lever arms a_i, each muscle has the length L_i0 - a_i q, the torque is the sum of a_i F_i,
and at constant pressures stiffness = -d torque/dq is the sum of a_i^2 dF_i/dL. The arms are those
of round pulleys: they do not depend on the position. A spring or a weight at the joint is not part
of it; whoever asks for a torque asks for what the muscles have to give.

For models affine in pressure the inverse is exact (`muscle_inverse`); for others, it is iterated
(`iterated_inverse`).

Source: section on antagonistic joints of "A Review of Design and Modeling of Pneumatic
Artificial Muscle".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pam_model.bounds import within
from pam_model.errors import DomainError
from pam_model.joints.affine_inverse import Line, affine_pressures, is_limited
from pam_model.joints.iterated_inverse import (
    iterated_pressures,
    line_of_muscle,
    pressures_of_lines,
)
from pam_model.joints.joint_muscle import JointMuscle, JointPressures
from pam_model.joints.muscle_inverse import AGAINST_EACH_OTHER
from pam_model.rig.types import Rig
from pam_model.robot.compose import compose
from pam_model.robot.robot import Robot, RobotJoint

_EDGE = 1e-6


class JointStatics:
    """Statics of one joint with any number of muscles, for plain floats.

    Pressures are sequences with one value [Pa gauge] for each muscle.

    Parameters
    ----------
    muscles : sequence of JointMuscle
        At least one.
    arms : sequence of float
        Torque per pull of each muscle [m]: positive if it pulls towards positive positions.
    ambient_pressure : float, optional
        [Pa absolute].
    exponent : float, optional
        Polytropic exponent of shut chambers [-].

    Raises
    ------
    DomainError
        If there is no muscle or not one arm for each, for an arm that is 0 or not finite, for a
        pressure that is not above 0, or an exponent outside 1 to 1.4.
    """

    def __init__(
        self,
        muscles: Sequence[JointMuscle],
        arms: Sequence[float],
        *,
        ambient_pressure: float = 101325.0,
        exponent: float = 1.0,
    ) -> None:
        within("ambient_pressure", ambient_pressure, unit="Pa", above=0.0, error=DomainError)
        within("exponent", exponent, 1.0, 1.4, error=DomainError)
        if not muscles or len(arms) != len(muscles):
            raise DomainError(
                f"{len(arms)} arms for {len(muscles)} muscles: one for each of at least one muscle"
            )
        for arm in arms:
            if not math.isfinite(arm) or arm == 0.0:
                raise DomainError(f"arm = {arm} m must be a finite number other than 0")
        self.muscles, self.arms = tuple(muscles), tuple(arms)
        self.radius = abs(arms[0])
        """Of the first muscle [m]; the ratios of the arms refer to it."""
        self.ratios = tuple(arm / self.radius for arm in arms)
        self.ambient_pressure, self.exponent = ambient_pressure, exponent
        # looked up once, because the fits of a controller ask for many torques
        self._pulls = tuple(
            (muscle.model.force, muscle.neutral_length, arm, ratio)
            for muscle, arm, ratio in zip(self.muscles, self.arms, self.ratios, strict=True)
        )
        self._is_pair = self.ratios == AGAINST_EACH_OTHER
        self._is_affine = all(muscle.affine_model is not None for muscle in muscles)
        ends = []
        for muscle, arm in zip(muscles, arms, strict=True):
            low, high = muscle.model.length_bounds
            edge = _EDGE * (min(high, 10.0 * muscle.neutral_length) - low)
            ends.append(
                sorted(
                    (muscle.neutral_length - length) / arm for length in (low + edge, high - edge)
                )
            )
        self.position_range = (max(low for low, _ in ends), min(high for _, high in ends))
        """Range of positions in the domain of all models [rad]."""

    @classmethod
    def from_robot(
        cls,
        robot: Robot,
        joint: RobotJoint,
        *,
        min_pressure: float = 0.0,
        pressure_share: float = 1.0,
    ) -> JointStatics:
        """A joint of a robot, with its static effects.

        Parameters
        ----------
        robot : Robot
            The robot.
        joint : RobotJoint
            One of its joints.
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
        return cls(
            muscles,
            [arm.length for arm in joint.arms],
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
    ) -> JointStatics:
        """The joint, by name or number, of the robot of a rig file; otherwise as `from_robot`.

        Raises
        ------
        UnknownNameError
            For an unknown joint.
        """
        robot = compose(rig)
        return cls.from_robot(
            robot,
            robot.joints[rig.joint_number(joint)],
            min_pressure=min_pressure,
            pressure_share=pressure_share,
        )

    def lengths(self, position: float) -> tuple[float, ...]:
        """Lengths of the muscles [m] at a position [rad]."""
        return tuple([neutral - arm * position for _, neutral, arm, _ in self._pulls])

    def tensions(
        self, pressures: Sequence[float], position: float, velocity: float = 0.0
    ) -> tuple[float, ...]:
        """Pulls of the muscles [N], never below 0, at a position [rad] and velocity [rad/s].

        Raises
        ------
        DomainError
            If the position is outside the domain of a model.
        """
        speed = self.radius * velocity
        return tuple(
            [
                max(0.0, float(force(pressure, neutral - arm * position, -ratio * speed)))
                for (force, neutral, arm, ratio), pressure in zip(
                    self._pulls, pressures, strict=True
                )
            ]
        )

    def tension(self, number: int, pressure: float, position: float) -> float:
        """Pull of one muscle [N] at rest, by its number; otherwise as `tensions`."""
        force, neutral, arm, _ = self._pulls[number]
        return max(0.0, float(force(pressure, neutral - arm * position)))

    def torque(self, pressures: Sequence[float], position: float, velocity: float = 0.0) -> float:
        """Torque of the muscles [N m]; arguments and errors as for `tensions`."""
        return self.torque_of(self.tensions(pressures, position, velocity))

    def torque_range(self, pressures: Sequence[float], position: float) -> tuple[float, float]:
        """Least and largest torque [N m]: only the muscles of one direction have a pressure."""
        least, largest = (
            self.torque(
                [
                    pressure if sign * arm > 0.0 else 0.0
                    for pressure, arm in zip(pressures, self.arms, strict=True)
                ],
                position,
            )
            for sign in (-1.0, 1.0)
        )
        return least, largest

    def torques(self, several: Sequence[Sequence[float]], position: float) -> list[float]:
        """Torques [N m] of several sets of pressures at one position, at rest; see `tensions`."""
        if not self._is_affine:
            return [self.torque(pressures, position) for pressures in several]
        pulls = [
            muscle.affine_model.coefficients(length)
            for muscle, length in zip(self.muscles, self.lengths(position), strict=True)
            if muscle.affine_model is not None
        ]
        return [
            self.torque_of(
                [
                    max(0.0, pressure * scale + passive)
                    for pressure, (scale, passive) in zip(pressures, pulls, strict=True)
                ]
            )
            for pressures in several
        ]

    def torque_of(self, pulls: Sequence[float]) -> float:
        """Torque [N m] of the pulls of the muscles [N]."""
        total = 0.0
        for ratio, pull in zip(self.ratios, pulls, strict=True):
            total += ratio * pull
        return self.radius * total

    def grip(self, pressures: Sequence[float], position: float) -> float:
        """Sum of the muscles' torques [N m] without their signs; arguments as of `tensions`."""
        pulls = self.tensions(pressures, position)
        ratios = zip(self.ratios, pulls, strict=True)
        return self.radius * sum([abs(ratio) * pull for ratio, pull in ratios])

    def stiffness(self, pressures: Sequence[float], position: float) -> float:
        """Stiffness at constant pressures [N m/rad]; a slack muscle adds nothing."""
        return self._stiffness(
            pressures,
            position,
            lambda muscle, pressure, length: float(muscle.model.stiffness(pressure, length)),
        )

    def closed_stiffness(self, pressures: Sequence[float], position: float) -> float:
        """Stiffness with all chambers shut [N m/rad]; a slack muscle adds nothing."""
        return self._stiffness(
            pressures,
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
        pressures: Sequence[float],
        position: float,
        rate: Callable[[JointMuscle, float, float], float],
    ) -> float:
        total = 0.0
        for muscle, ratio, pressure, length in zip(
            self.muscles, self.ratios, pressures, self.lengths(position), strict=True
        ):
            if float(muscle.model.force(pressure, length)) > 0.0:
                total += ratio * ratio * rate(muscle, pressure, length)
        return self.radius * self.radius * total

    def volumes(self, position: float) -> tuple[float, ...]:
        """Gas volumes [m^3], including dead volumes."""
        return tuple(
            float(muscle.model.volume(length)) + muscle.dead_volume
            for muscle, length in zip(self.muscles, self.lengths(position), strict=True)
        )

    def volume_slopes(self, position: float) -> tuple[float, ...]:
        """dV/dq of the muscles [m^3/rad]."""
        return tuple(
            -arm * float(muscle.model.volume_slope(length))
            for muscle, arm, length in zip(
                self.muscles, self.arms, self.lengths(position), strict=True
            )
        )

    def pressures_for(self, torque: float, stiffness: float, position: float) -> JointPressures:
        """The pressures for a torque and a stiffness at constant pressures.

        The request is limited to the range of the pressures: first the torque to its reachable
        range, then the stiffness to the range that is reachable at this torque. Where more than
        two muscles leave a choice, the sum of squares of the pressures is the least. With models
        that are not affine in pressure, muscles of one side, or more than two, may miss a stiffness
        near the end of its range by a few per cent, which then counts as limited.

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
        lines = self.lines(inside)
        if self._is_pair:  # what the general inverse finds too, but more slowly
            first, second, reached, stiff, cut, soft = affine_pressures(
                lines[0], lines[1], self.radius, torque, stiffness
            )
            pressures: tuple[float, ...] = first, second
        else:
            pressures, reached, stiff, cut, soft = pressures_of_lines(
                lines, self.ratios, self.radius, torque, stiffness
            )
        if not self._is_affine:
            pressures = iterated_pressures(
                self.muscles,
                self.ratios,
                self.radius,
                lines,
                self.lengths(inside),
                torque,
                stiffness,
            )
            reached = self.torque(pressures, inside)
            stiff = self.stiffness(pressures, inside)
            strongest = sum(
                abs(ratio) * line[1] for ratio, line in zip(self.ratios, lines, strict=True)
            )
            cut, soft = is_limited(
                self.radius * strongest, reached - torque, stiff - stiffness, stiffness
            )
        return JointPressures(pressures, reached, stiff, cut, soft, inside != position)

    def lines(self, position: float) -> list[Line]:
        """What each muscle does at a position [rad], in the range of its pressures."""
        return [
            line_of_muscle(muscle, muscle.neutral_length - arm * position)
            for muscle, arm in zip(self.muscles, self.arms, strict=True)
        ]
