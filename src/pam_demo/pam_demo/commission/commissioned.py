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
    """One motion of the sequence, as it was played.

    Attributes
    ----------
    motion : str
        Its name.
    title : str
        What it was.
    share : float
        Of the motion as it was asked for [-].
    foreseen, most : tuple of three floats
        Use of the limits by the least favourable robot, and as it was measured [-]: pressure,
        speed, distance from the middle of the range.
    """

    motion: str
    title: str
    share: float
    foreseen: tuple[float, float, float]
    most: tuple[float, float, float]


@dataclass(slots=True)
class Commissioned:
    """What a commissioning has found.

    Attributes
    ----------
    rig : Rig or None
        The identified rig of the joint; None if the sequence was ended.
    ended : str
        Why it was ended; empty if it was not.
    steps : list of SequenceStep
        The motions.
    calibration : Calibration or None
        The last identification.
    points : sequence of TrajectoryPoint
        The motion of the tracking test.
    before, after : Tracked or None
        The tracking test with the numbers as written and as identified.
    gains : list of dict
        Designed gains by stiffness [N m/rad].
    seconds : float
        Time of the recordings [s].
    exchanged : str
        What was exchanged, as the new rig file describes it; empty if nothing was.
    expected : Expected or None
        The tracking test on simulated robots that are as identified.
    doubt : str
        Why the tracking is not as good as it should be, or is not known well; empty if it is.
    """

    rig: Rig | None = None
    ended: str = ""
    steps: list[SequenceStep] = field(default_factory=list)
    calibration: Calibration | None = None
    points: Sequence[TrajectoryPoint] = ()
    before: Tracked | None = None
    after: Tracked | None = None
    gains: list[dict[str, float]] = field(default_factory=list)
    seconds: float = 0.0
    exchanged: str = ""
    expected: Expected | None = None
    doubt: str = ""
