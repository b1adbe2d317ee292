"""A rigid link of a robot, and the numbers of a tree of links that the kernels take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pam_model.body.hinge_tree import N_LINK_NUMBERS, N_LINK_SCRATCH, mass_and_bias
from pam_model.errors import PamError

Array = npt.NDArray[np.float64]
STANDARD_GRAVITY = (0.0, 0.0, -9.80665)
"""Acceleration of free fall in a base frame whose z axis points up [m/s^2]."""
_SMALLEST = 1e-9
_POSTURES = 64


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid link that turns about the z axis of its hinge."""

    parent: int = -1  # index of the link that carries the hinge, -1 for the base
    # axes of the hinge frame at angle 0, in columns, in the frame of the parent
    rotation: Array = field(default_factory=lambda: np.eye(3))
    # origin of the hinge in the frame of the parent [m]
    place: Array = field(default_factory=lambda: np.zeros(3))
    mass: float = 0.0  # [kg]
    # centre of mass in the link's own frame [m]
    centre: Array = field(default_factory=lambda: np.zeros(3))
    # about the centre of mass, in the link's own frame [kg m^2]
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))


def link_numbers(links: Sequence[Link]) -> Array:
    """The numbers of a tree (n, N_LINK_NUMBERS), as `hinge_tree.mass_and_bias` takes them.

    Raises
    ------
    PamError
        If a parent does not come before its link, an array has another shape or is not finite, a
        rotation is none, or a link with negative mass or an inertia that no body has.
    """
    rows = np.empty((len(links), N_LINK_NUMBERS))
    for i, link in enumerate(links):
        if not -1 <= link.parent < i:
            raise PamError(f"link {i}: parent {link.parent}, expected -1 (the base) to {i - 1}")
        numbers = {
            "rotation": (link.rotation, (3, 3)),
            "place": (link.place, (3,)),
            "centre": (link.centre, (3,)),
            "inertia": (link.inertia, (3, 3)),
        }
        found = {}
        for name, (given, shape) in numbers.items():
            array = np.asarray(given, dtype=float)
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise PamError(f"link {i}: {name} must have shape {shape} and be finite")
            found[name] = array
        turned, inertia = found["rotation"], found["inertia"]
        if not np.allclose(turned @ turned.T, np.eye(3)) or np.linalg.det(turned) < 0.0:
            raise PamError(f"link {i}: rotation is not a rotation matrix")
        moments = np.linalg.eigvalsh(inertia)
        if not link.mass >= 0.0 or not np.allclose(inertia, inertia.T, atol=_SMALLEST):
            raise PamError(f"link {i}: expected a mass of 0 kg or more and a symmetric inertia")
        if moments[0] < -_SMALLEST or moments[2] > moments[0] + moments[1] + _SMALLEST:
            raise PamError(
                f"link {i}: no body has the principal moments {moments.tolist()} kg m^2; each must "
                "be at least 0 and at most the sum of the others"
            )
        xx, yy, zz = np.diag(inertia)
        rows[i] = [
            link.parent, *turned.ravel(), *found["place"], link.mass, *found["centre"],
            xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2],
        ]  # fmt: skip
    return rows


def smallest_inertia(
    numbers: Array, own: Array, lower: Sequence[float], upper: Sequence[float]
) -> Array:
    """Smallest inertia that each joint feels while the others are free, 1/(M^-1)_ii [kg m^2].

    Parameters
    ----------
    numbers : (n, N_LINK_NUMBERS) array
        From `link_numbers`.
    own : (n,) array
        What each joint has in addition to its link [kg m^2].
    lower, upper : (n,) sequence
        Range of the joints [rad], in which postures are drawn.
    """
    n = len(own)
    least = np.full(n, np.inf)
    draw = np.random.default_rng(0)
    mass, bias, still = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    scratch = np.zeros((n, N_LINK_SCRATCH))
    gravity = np.zeros(3)
    for _ in range(_POSTURES):
        mass_and_bias(numbers, gravity, draw.uniform(lower, upper), still, scratch, mass, bias)
        least = np.minimum(least, 1.0 / np.diag(np.linalg.inv(mass + np.diag(own))))
    return least
