"""What a commissioning has found: its steps, the rig, and the tracking tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pam_control.references.trajectory import TrajectoryPoint
from pam_demo.commission.expected_tracking import Expected
from pam_demo.commission.tracking import Tracked
from pam_gap.calibration.calibration import Calibration
from pam_model.rig import Rig


@dataclass(slots=True)
class SequenceStep:
    """One motion of the sequence, as it was played."""

    motion: str  # its name
    title: str  # what it was
    share: float  # of the motion as it was asked for [-]
    # foreseen, most: use of the limits by the least favourable robot, and as it was measured [-]:
    # pressure, speed, distance from the middle of the range
    foreseen: tuple[float, float, float]
    most: tuple[float, float, float]


@dataclass(slots=True)
class Commissioned:
    """What a commissioning has found."""

    rig: Rig | None = None  # the identified rig of the joint; None if the sequence was ended
    ended: str = ""  # why it was ended; empty if it was not
    steps: list[SequenceStep] = field(default_factory=list)  # the motions
    calibration: Calibration | None = None  # the last identification
    points: Sequence[TrajectoryPoint] = ()  # the motion of the tracking test
    # before, after: the tracking test with the numbers as written and as identified
    before: Tracked | None = None
    after: Tracked | None = None
    # designed gains by stiffness [N m/rad]
    gains: list[dict[str, float]] = field(default_factory=list)
    seconds: float = 0.0  # time of the recordings [s]
    # what was exchanged, as the new rig file describes it; empty if nothing was
    exchanged: str = ""
    expected: Expected | None = None  # the tracking test on simulated robots
    # why the tracking is not as good as it should be, or is not known well; empty if it is
    doubt: str = ""
