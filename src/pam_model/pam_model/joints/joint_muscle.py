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
    """Pressures, the achieved torque and stiffness, and which requests were limited."""

    pressures: tuple[float, ...]  # one for each muscle of the joint, in its order [Pa gauge]
    torque: float  # achieved [N m]
    stiffness: float  # achieved, at constant pressures [N m/rad]
    # torque_limited, stiffness_limited: whether the request was outside the reachable range; torque
    # has priority over stiffness
    torque_limited: bool
    stiffness_limited: bool
    # whether the position was outside `position_range` and its nearest limit was used
    position_limited: bool

    @property
    def agonist(self) -> float:
        """Pressure of the first muscle [Pa gauge]."""
        return self.pressures[0]

    @property
    def antagonist(self) -> float:
        """Pressure of the second muscle [Pa gauge]."""
        return self.pressures[1]
