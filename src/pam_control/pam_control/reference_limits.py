"""Keeps the references to what the valves can drive, at the commanded stiffness and speed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_control.drivable_limits import DrivableLimits
from pam_control.joint_models import JointModels
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.trajectory import CommandError
from pam_model.rig import Rig
from pam_model.robot import Robot


class ReferenceLimits:
    """The commanded stiffness and the permitted speed of all joints.

    Parameters
    ----------
    robot : Robot
        The same robot as it holds.
    stiffnesses : sequence of float
        Until others are commanded [N m/rad].

    Attributes
    ----------
    references : ReferenceGenerator
        Of all joints.
    stiffnesses : list of float
        Commanded [N m/rad].
    reduced : bool
        Whether full speed is not permitted.
    """

    def __init__(
        self, rig: Rig, robot: Robot, joints: Sequence[JointModels], stiffnesses: Sequence[float]
    ) -> None:
        self._joints = joints
        self._limits = DrivableLimits(robot)
        self.stiffnesses = list(stiffnesses)
        self.reduced = rig.people.full_speed_topic
        self._slow = self.reduced  # what the references keep
        self.references = ReferenceGenerator(
            {joint.name: joint.position_limits for joint in rig.joints},
            {
                models.name: self._limits.at(models, stiffness, reduced=self._slow)
                for models, stiffness in zip(joints, stiffnesses, strict=True)
            },
            max_velocities={joint.name: joint.max_velocity for joint in rig.joints},
            start_margin=rig.plausibility.position_margin,
        )

    def command(self, values: Sequence[float]) -> None:
        """Take the stiffness of every joint [N m/rad].

        Raises
        ------
        CommandError
            For a wrong size, or a value that is not finite or not above 0; nothing is changed.
        """
        if len(values) != len(self._joints):
            raise CommandError(
                f"stiffness command rejected: {len(values)} values for {len(self._joints)} joints"
            )
        for models, value in zip(self._joints, values, strict=True):
            if not (math.isfinite(value) and value > 0.0):
                raise CommandError(f"stiffness command rejected: {models.name} at {value} N m/rad")
        self.use([float(value) for value in values])

    def use(self, stiffnesses: Sequence[float]) -> None:
        """Use these stiffnesses [N m/rad], of all joints."""
        self.stiffnesses = list(stiffnesses)
        for models, stiffness in zip(self._joints, stiffnesses, strict=True):
            limits = self._limits.at(models, stiffness, reduced=self._slow)
            self.references.limit(models.name, limits)

    def foresees(self, values: Sequence[float]) -> bool:
        """Whether the limits for these stiffnesses [N m/rad] are known already."""
        return all(
            not math.isfinite(value) or self._limits.knows(models, value)
            for models, value in zip(self._joints, values, strict=False)
        )

    def foresee(self, values: Sequence[float]) -> None:
        """Compute limits for stiffnesses [N m/rad] that will be commanded; needs no lock."""
        for models, value in zip(self._joints, values, strict=False):
            if math.isfinite(value):
                self._limits.at(models, value)

    def reduce_speed(self, reduced: bool, now: float) -> None:
        """Keep the joints' `reduced_velocity`, or no longer, from a time [s] on.

        Either change brakes the joints and holds them (stop category 2), so that no reference
        becomes faster by itself.
        """
        if reduced != self.reduced:
            self.reduced = reduced
            self.references.stop([], now)

    @property
    def braking(self) -> bool:
        """Whether the joints brake because another speed is permitted now."""
        return self._slow != self.reduced

    def advance(self) -> None:
        """Use the other limit of speed as soon as all references have braked below it."""
        if self.braking and all(
            self.references.speed(models.name)
            <= self._limits.at(models, stiffness, reduced=self.reduced).velocity
            for models, stiffness in zip(self._joints, self.stiffnesses, strict=True)
        ):
            self._slow = self.reduced
            self.use(self.stiffnesses)
