"""Inverse of a flow valve's effects: from the desired opening to the spool command.

The inverse laws are defined in the files of the effects (`pam_model.effects`), next to the laws
that they invert. Effects of the flow path are inverted first, for example an exhaust path that is
narrower than the supply path; the result may saturate. Then the effects between spool and opening
are inverted, in the reverse of the order in which the plant applies them.

Source: inverses of actuator nonlinearities as in G. Tao, P. V. Kokotovic, Adaptive Control of
Systems with Actuator and Sensor Nonlinearities, Wiley 1996.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from pam_model.effects import EFFECTS, Effect, Inverse, active, bound, filled
from pam_model.effects.slots import Opening
from pam_model.rig import Muscle

Law = Callable[[float], float]


def _inverse_of(effect: Effect, muscle: Muscle) -> Law | None:
    """The inverse law with this muscle's parameters; None if the muscle lacks the effect."""
    if not isinstance(effect.control, Inverse) or not active(effect, muscle.effects):
        return None
    return bound(effect.control.law, effect.values(muscle.effects))


@dataclass(frozen=True, slots=True)
class ValveInverse:
    """The inverse laws of one valve's effects; without effects the opening is unchanged.

    Attributes
    ----------
    flow_path : tuple of callable
        From the opening of a valve with two equal paths to that of the true valve [-].
    spool_path : tuple of callable
        From opening to spool position [-]; the law that the plant applies last comes first.
    """

    flow_path: tuple[Law, ...] = ()
    spool_path: tuple[Law, ...] = ()

    @classmethod
    def from_muscle(cls, muscle: Muscle) -> ValveInverse:
        """Create it from the effects that the rig file names."""
        invert = partial(_inverse_of, muscle=muscle)
        at_spool = [effect for effect, _ in filled(Opening)]
        flow = [effect for effect in EFFECTS.values() if effect not in at_spool]
        return cls(
            tuple(law for law in map(invert, flow) if law is not None),
            tuple(law for law in map(invert, reversed(at_spool)) if law is not None),
        )

    def opening(self, nominal: float) -> float:
        """Opening [-] with the flow that `nominal` gives on a valve with two equal paths."""
        for law in self.flow_path:
            nominal = law(nominal)
        return nominal

    def spool(self, opening: float) -> float:
        """The spool position [-] that gives this opening [-]."""
        for law in self.spool_path:
            opening = law(opening)
        return opening
