"""A joint whose numbers in the rig file may be a little off, and its statics if they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, Protocol

from pam_control.adaptation.rig_numbers import DRY_FRICTION, Place
from pam_model.effects import effect_value
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Joint, Muscle, Rig
from pam_model.robot import compose_in_parts
from pam_model.views.inverse_dynamics import InverseDynamics

OF_MUSCLES: Final = ("thread_length", "turns", "neutral_length")
MOST_MUSCLES: Final = 64  # that are kept, because changed joints share them


class VariedJoint(Protocol):
    """What `StiffnessEstimate` asks about a joint of any number of muscles.

    Attributes
    ----------
    numbers : sequence
        The numbers that the stiffness depends on.
    tolerance : float
        Of these numbers, relative [-].
    """

    @property
    def numbers(self) -> Sequence[object]:
        """See above."""
        ...

    @property
    def tolerance(self) -> float:
        """See above."""
        ...

    def changed(self, changes: Sequence[float]) -> Iterator[JointStatics | None]:
        """The joint with relative changes of its numbers; PamError where there is none.

        It comes after some None, each after a part of the work that a control cycle has time for.
        """
        ...

    def places(self, dynamics: InverseDynamics) -> list[Place]:
        """Where each number is written; after them inertia, friction, gravity, dry friction."""
        ...


class JointOfRig:
    """A joint of a rig file."""

    def __init__(self, rig: Rig, joint: Joint) -> None:
        # of one joint alone, because the models with changed numbers are built in a control cycle
        muscles = tuple(rig.muscle(name) for name in joint.muscles)
        self._rig, self._joint = replace(rig, joints=(joint,), muscles=muscles), joint
        self._muscles: dict[tuple[str | float, ...], JointMuscle] = {}
        self.tolerance = rig.parameter_tolerance
        self.numbers: list[tuple[str, str]] = [(joint.name, "pulley_radius")] + [
            (name, key)
            for name in joint.muscles
            for key in OF_MUSCLES
            if getattr(rig.muscle(name), key, None)
        ]

    def changed(self, changes: Sequence[float]) -> Iterator[JointStatics | None]:
        """See `VariedJoint`."""
        new: dict[str, dict[str, Any]] = {}
        for (owner, key), change in zip(self.numbers, changes, strict=True):
            part = self._joint if owner == self._joint.name else self._rig.muscle(owner)
            new.setdefault(owner, {})[key] = (1.0 + change) * getattr(part, key)
        joint = replace(self._joint, **new.get(self._joint.name, {}))
        muscles: list[Muscle] = []
        for one in self._rig.muscles:
            yield None
            muscles.append(replace(one, **new.get(one.name, {})))
        yield None
        rig = replace(self._rig, joints=(joint,), muscles=tuple(muscles))
        for robot in compose_in_parts(rig):
            yield None
            if robot is not None:
                yield self._sharing(JointStatics.from_robot(robot, robot.joints[0]), new)

    def _sharing(self, made: JointStatics, new: Mapping[str, dict[str, float]]) -> JointStatics:
        """The same joint with the muscles of others that it shares all numbers with."""
        if len(self._muscles) > MOST_MUSCLES:
            self._muscles.clear()
        muscles = [
            self._muscles.setdefault((name, *new.get(name, {}).values()), muscle)
            for name, muscle in zip(self._joint.muscles, made.muscles, strict=True)
        ]
        return JointStatics(
            muscles, made.arms, ambient_pressure=made.ambient_pressure, exponent=made.exponent
        )

    def places(self, dynamics: InverseDynamics) -> list[Place]:
        """See `VariedJoint`."""
        joint, places = self._joint, []
        for owner, key in self.numbers:
            part = joint if owner == joint.name else self._rig.muscle(owner)
            written = float(getattr(part, key))
            places.append(Place(owner, key, written, written))
        for key in ("inertia", "viscous_friction", "gravity_torque"):
            # with effects such as a payload, which stay as they are
            places.append(Place(joint.name, key, getattr(joint, key), getattr(dynamics.joint, key)))
        dry = effect_value(joint.effects, *DRY_FRICTION.split("."))
        return [*places, Place(joint.name, DRY_FRICTION, dry, 1.0)]
