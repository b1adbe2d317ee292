"""Which kernel simulates which lanes of a batch: one for each set of groups of laws that they need.

A law that is masked costs as much where it is neutral as where it acts, and a lane takes several
times as long in a kernel with all laws as in one without any. A kernel for every combination of
effects would have too few lanes and take too long to compile. The laws are therefore put into
groups, and there is a kernel for every set of groups that a lane needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.plant import layout as lay
from pam_model.plant.lane_twins import LaneVariant

Switches = dict[str, tuple[int, bool]]
"""Name of each switch, the index of its constant, and whether each muscle has one."""


def _of_muscles(*names: str) -> Switches:
    return {name: (int(getattr(lay, name)), True) for name in names}


def _of_joint(*names: str) -> Switches:
    return {name: (int(getattr(lay, name)), False) for name in names}


def _of_effects(stage: str) -> Switches:
    """The switches of all effects of a stage whose laws fill a slot of the plant."""
    joint = {name: (one.is_on, False) for name, one in lay.JOINT_EFFECTS.items()
             if one.effect.stage == stage}  # fmt: skip
    muscle = {name: (one.is_on, True) for name, one in lay.MUSCLE_EFFECTS.items()
              if one.effect.stage == stage}  # fmt: skip
    return {f"{name.upper()}_IS_ON": place for name, place in (joint | muscle).items()}


OF_RIG: Final = _of_muscles("M_TABLE", "M_REGULATOR", "M_WALL")
"""Switches of what all lanes of a batch have or have not, as their rig does."""
CABLE: Final = "cable"
MUSCLE: Final = "muscle"
VECTOR: Final = 8
"""Lanes of one vector register."""
TWO_VECTORS: Final = 16
"""LLVM uses no vectors for fewer lanes in the longest loops."""
GROUPS: Final[dict[str, Switches]] = {
    "gas": _of_muscles("M_TUBE", "M_THERMAL") | _of_joint("C_DROOP") | _of_effects("valve"),
    "joint": _of_joint("C_PRESLIDING", "C_ARM_SLOPE", "C_ARM_BEND") | _of_effects("joint"),
    MUSCLE: _of_muscles("M_THREAD") | _of_effects("muscle"),
    CABLE: _of_muscles("M_CABLE"),  # iterates, which takes longer than all others together
}
"""Switches of all laws of effects that the stages call, in groups."""
LAWS: Final[Switches] = {name: place for group in GROUPS.values() for name, place in group.items()}
FEW: Final = 3
"""Lanes up to which one after the other is not slower than a vector."""
FEW_WITH_CABLE: Final = 1
"""The same where the cable's is the only group, as iterating takes long one after the other."""


@dataclass(frozen=True, slots=True)
class LaneKernel:
    """A kernel for several lanes."""

    off: frozenset[str]  # switches that the kernel takes for 0
    serves: npt.NDArray[np.bool_]  # whether these are 0 in each lane of a batch
    muscles: int  # number of muscles of each joint

    @property
    def variant(self) -> LaneVariant:
        """The variant of the plant for which the kernel is made."""
        return LaneVariant(self.off, self.muscles)

    def _has(self, group: str) -> bool:
        return not GROUPS[group].keys() <= self.off

    @property
    def few(self) -> int:
        """Number of lanes up to which one after the other is not slower."""
        return FEW_WITH_CABLE if self._has(CABLE) and not self._has(MUSCLE) else FEW

    @property
    def vector(self) -> int:
        """The number of lanes that are simulated is a multiple of this one."""
        return TWO_VECTORS if self._has(CABLE) and self._has(MUSCLE) else VECTOR

    def for_all(self, count: int) -> LaneKernel:
        """The same kernel for a batch of `count` lanes, all of which it serves."""
        return LaneKernel(self.off, np.full(count, True), self.muscles)


def lane_kernels(constants: npt.NDArray[np.float64]) -> tuple[LaneKernel, ...]:
    """A kernel for every set of groups that lanes of a batch need, the fastest one first.

    Parameters
    ----------
    constants : (n_batch, n_constants) array
        Of each plant.
    """
    starts = range(lay.C_MUSCLES, constants.shape[1], lay.N_MUSCLE_CONSTANTS)

    def any_of(switches: Switches) -> npt.NDArray[np.bool_]:
        places = [
            at
            for place, of_muscle in switches.values()
            for at in ([first + place for first in starts] if of_muscle else [place])
        ]
        return np.asarray(constants[:, places].any(axis=1))

    absent = frozenset(name for name in OF_RIG if not any_of({name: OF_RIG[name]}).any())
    needs = np.stack([any_of(group) for group in GROUPS.values()], axis=1)
    kernels = []
    for need in sorted(set(map(tuple, needs.tolist())), key=lambda need: (sum(need), need[::-1])):
        idle = [group for group, needed in zip(GROUPS.values(), need, strict=True) if not needed]
        off = absent.union(*idle)
        kernels.append(LaneKernel(off, ~needs[:, ~np.array(need)].any(axis=1), len(starts)))
    return tuple(kernels)
