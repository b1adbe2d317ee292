"""What a joint needs of its muscles, and what it answers about their pressures."""

from __future__ import annotations

from dataclasses import dataclass, field

from pam_model.muscles.force_model import AffineForceModel, ForceModel


@dataclass(frozen=True, slots=True)
class JointMuscle:
    """The properties of a muscle that its joint needs."""

    model: ForceModel  # the static force
    neutral_length: float  # at joint position 0 [m]
    # low_pressure, high_pressure: range of the commands [Pa gauge]
    low_pressure: float
    high_pressure: float
    dead_volume: float = 0.0  # [m^3]
    # the same model if it is affine in pressure, so that its inverse is exact
    affine_model: AffineForceModel | None = field(init=False)

    def __post_init__(self) -> None:
        # checked once, because checking a protocol takes longer than solving the joint
        affine = self.model if isinstance(self.model, AffineForceModel) else None
        object.__setattr__(self, "affine_model", affine)


@dataclass(slots=True)
class JointPressures:
    """Pressures, the achieved torque and stiffness, and which requests were limited.

    Attributes
    ----------
    pressures : tuple of float
        One for each muscle of the joint, in its order [Pa gauge].
    torque : float
        Achieved [N m].
    stiffness : float
        Achieved, at constant pressures [N m/rad].
    torque_limited, stiffness_limited : bool
        Whether the request was outside the reachable range; torque has priority over stiffness.
    position_limited : bool
        Whether the position was outside `position_range` and its nearest limit was used.
    """

    pressures: tuple[float, ...]
    torque: float
    stiffness: float
    torque_limited: bool
    stiffness_limited: bool
    position_limited: bool

    @property
    def agonist(self) -> float:
        """Pressure of the first muscle [Pa gauge]."""
        return self.pressures[0]

    @property
    def antagonist(self) -> float:
        """Pressure of the second muscle [Pa gauge]."""
        return self.pressures[1]
