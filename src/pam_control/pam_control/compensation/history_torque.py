"""Joint torque that depends on the motion before, predicted along the joint's reference.

That of hysteresis and creep of the muscles, and of the dry friction of the joint.
"""

from __future__ import annotations

import math

from pam_control.compensation.dry_friction import DryFriction
from pam_control.compensation.muscle_memory import MuscleMemory
from pam_control.references.spline import JointReference
from pam_model.robot import RobotMuscle

Pair = tuple[float, float]


class HistoryTorque:
    """The states of both muscles and of the dry friction, advanced along the reference.

    Parameters
    ----------
    muscles : (RobotMuscle, RobotMuscle)
        Agonist, antagonist.
    pulley_radius : float
        Of the joint [m].
    friction : DryFriction
        Of the joint.
    """

    def __init__(
        self, muscles: tuple[RobotMuscle, ...], pulley_radius: float, friction: DryFriction
    ) -> None:
        self._radius, self._friction = pulley_radius, friction
        self._agonist, self._antagonist = (MuscleMemory.from_muscle(m) for m in muscles)
        self.is_neutral = (
            self._agonist.is_neutral and self._antagonist.is_neutral and not friction.laws
        )
        self.reset()

    def reset(self) -> None:
        """Reset the states."""
        self._position = self._time = math.nan
        self._slip = 0.0
        self._agonist.reset()
        self._antagonist.reset()

    def advance(self, time: float, reference: JointReference, pressures: Pair) -> float:
        """Advance the states along the reference to `time` and return their torque.

        Parameters
        ----------
        time : float
            Not earlier than in the last call [s].
        reference : JointReference
            Reference at that time.
        pressures : (float, float)
            Approximate pressures of the muscles at that time, gauge [Pa].

        Returns
        -------
        float
            Torque on the joint [N m].
        """
        if self.is_neutral:
            return 0.0
        position = reference.position
        if not math.isnan(self._position):
            travel = position - self._position
            self._slip = self._friction.slipped(self._slip, travel, reference)
            stroke = self._radius * travel
            duration = max(time - self._time, 0.0)
            self._agonist.move(-stroke, duration)
            self._antagonist.move(stroke, duration)
        self._position, self._time = position, time
        pull = self._agonist.pull(pressures[0]) - self._antagonist.pull(pressures[1])
        return self._radius * pull - self._slip * self._friction.level(reference.velocity)
