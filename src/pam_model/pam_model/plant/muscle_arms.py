"""Which muscles turn a joint, and in which direction with which lever arm."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.physics.joint_geometry import AGONIST_SIGN, ANTAGONIST_SIGN
from pam_model.plant.layout import JOINT_NOMINAL


class MuscleArm(NamedTuple):
    """A muscle of a joint."""

    name: str  # with which the names of its parameters, states and outputs begin
    # its lever arm over the radius of the pulley [-]; above 0 if its pull turns the joint in the
    # positive direction
    arm: float


MuscleArms = tuple[MuscleArm, ...]
RESERVED: Final = frozenset(name.partition(".")[0] for name, _ in JOINT_NOMINAL) | EFFECTS.keys()
"""Words with which other names of parameters begin."""

PAIR: Final[MuscleArms] = (
    MuscleArm("agonist", AGONIST_SIGN),
    MuscleArm("antagonist", ANTAGONIST_SIGN),
)
"""The muscles of a joint as a rig file states them."""
SIDES: Final = tuple(muscle.name for muscle in PAIR)
"""Their names."""


def names_of(muscles: Iterable[MuscleArm]) -> tuple[str, ...]:
    """The names of muscles."""
    return tuple(muscle.name for muscle in muscles)


def checked_muscles(muscles: Sequence[MuscleArm]) -> MuscleArms:
    """The muscles of a joint, if they can be such.

    Raises
    ------
    PamError
        Without a muscle, for a name that is not one word or occurs twice, or an arm that is 0 or
        not finite.
    """
    names = names_of(muscles)
    if not names:
        raise PamError("a joint without muscles: expected at least one")
    for name, arm in muscles:
        if not name.isidentifier() or name in RESERVED or names.count(name) > 1:
            raise PamError(f"{name!r} as the name of a muscle: expected one word for each muscle")
        if not math.isfinite(arm) or arm == 0.0:
            raise PamError(
                f"lever arm {arm} of muscle {name}: expected a finite number that is not 0"
            )
    return tuple(muscles)
