"""A joint whose numbers in the rig file may be a little off, and its statics if they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, Protocol

from pam_control.adaptation.rig_numbers import DRY_FRICTION, Place
from pam_model.effects import effect_value
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.rig import Joint, Muscle, Rig
from pam_model.rig.arms import arm_lengths
from pam_model.robot import effective_force_model
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
        self._joint, self._gas = joint, rig.gas
        self._written = {name: rig.muscle(name) for name in joint.muscles}
        self._supply = rig.supply_gauge_pressure
        self._muscles: dict[tuple[str | float, ...], JointMuscle] = {}
        self.tolerance = rig.parameter_tolerance
        self.numbers: list[tuple[str, str]] = [(joint.name, "pulley_radius")] + [
            (name, key)
            for name, muscle in self._written.items()
            for key in OF_MUSCLES
            if getattr(muscle, key, None)
        ]

    def _part(self, owner: str) -> Joint | Muscle:
        return self._joint if owner == self._joint.name else self._written[owner]

    def changed(self, changes: Sequence[float]) -> Iterator[JointStatics | None]:
        """See `VariedJoint`; the muscles with the same numbers are shared."""
        new: dict[str, dict[str, float]] = {self._joint.name: {}}
        for (owner, key), change in zip(self.numbers, changes, strict=True):
            new.setdefault(owner, {})[key] = (1.0 + change) * getattr(self._part(owner), key)
        if len(self._muscles) > MOST_MUSCLES:
            self._muscles.clear()
        muscles = []
        for name in self._joint.muscles:
            numbers: dict[str, float] = new.get(name, {})
            shared: tuple[str | float, ...] = (name, *numbers.values())
            if shared not in self._muscles:
                for part in self._muscle(self._written[name], numbers):
                    if part is None:
                        yield None
                    else:
                        self._muscles[shared] = part
            muscles.append(self._muscles[shared])
        yield None
        yield JointStatics(
            muscles,
            arm_lengths(self._joint, new[self._joint.name].get("pulley_radius")),
            ambient_pressure=self._gas.ambient_pressure,
            exponent=self._gas.polytropic_exponent,
        )

    def _muscle(
        self, written: Muscle, numbers: Mapping[str, float]
    ) -> Iterator[JointMuscle | None]:
        """A muscle with changed numbers; None comes before each part of the work."""
        thread_length, turns, neutral_length = (
            numbers.get(name, getattr(written, name)) for name in OF_MUSCLES
        )
        yield None
        geometry = MuscleGeometry(thread_length, turns, written.rest_length, written.wall_thickness)
        nominal = create_force_model(written.model, geometry, written.model_parameters)
        yield None
        force = effective_force_model(written.effects, geometry, nominal)
        yield JointMuscle(force, neutral_length, 0.0, min(written.max_pressure, self._supply))

    def places(self, dynamics: InverseDynamics) -> list[Place]:
        """See `VariedJoint`."""
        joint, places = self._joint, []
        for owner, key in self.numbers:
            written = float(getattr(self._part(owner), key))
            places.append(Place(owner, key, written, written))
        for key in ("inertia", "viscous_friction", "gravity_torque"):
            # with effects such as a payload, which stay as they are
            places.append(Place(joint.name, key, getattr(joint, key), getattr(dynamics.joint, key)))
        dry = effect_value(joint.effects, *DRY_FRICTION.split("."))
        return [*places, Place(joint.name, DRY_FRICTION, dry, 1.0)]
