"""The history-dependent states of a muscle, advanced along its reference length.

Thread friction, creep and every other effect with a state and an exact step are computed along the
reference, ahead of time, so they do not change the feedback loop. A state starts at 0, because the
initial state of the muscle is unknown. The laws are defined in the files of the effects
(`pam_model.effects`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pam_model.effects import TorqueFeedforward
from pam_model.effects.slots import PullState
from pam_model.robot import RobotMuscle


@dataclass(slots=True)
class _State:
    """State of one effect, with its law and the muscle's parameters."""

    slot: PullState
    treatment: TorqueFeedforward
    values: tuple[float, ...]
    value: float = 0.0


@dataclass(slots=True)
class MuscleMemory:
    """The states of one muscle along its reference.

    Attributes
    ----------
    braid_area : float
        b^2/(4 pi n^2) [m^2].
    braid_slope : float
        6 rest_length/(4 pi n^2) [m].
    """

    braid_area: float
    braid_slope: float
    _states: list[_State] = field(default_factory=list)

    @classmethod
    def from_muscle(cls, muscle: RobotMuscle) -> MuscleMemory:
        """Create it from the effects that the rig file names."""
        braid = muscle.geometry
        scale = 1.0 / (4.0 * math.pi * braid.turns**2)
        return cls(
            braid.thread_length**2 * scale,
            6.0 * braid.rest_length * scale,
            [
                _State(slot, effect.control, values)
                for effect, slot, values in muscle.laws(PullState)
                if isinstance(effect.control, TorqueFeedforward)
            ],
        )

    @property
    def is_neutral(self) -> bool:
        """Whether the muscle has no such states."""
        return not self._states

    def reset(self) -> None:
        """Set all states to 0."""
        for state in self._states:
            state.value = 0.0

    def move(self, stroke: float, duration: float) -> None:
        """Lengthen by `stroke` [m] evenly within `duration` [s]."""
        for state in self._states:
            step = state.treatment.step
            assert step is not None  # checked where the effect is declared
            state.value = step(state.value, stroke, duration, *state.values)

    def pull(self, pressure: float) -> float:
        """Additional muscle force [N] due to the states at a gauge pressure [Pa]."""
        return sum(
            state.slot.pull(
                state.value, pressure, self.braid_area, self.braid_slope, *state.values
            )[0]
            for state in self._states
        )
