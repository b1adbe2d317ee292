"""What is in force for one joint until the settings change: made of settings, law and gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pam_control.declared import BY_SIZE, sized
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.margins import Margins
from pam_control.joint_models import JointModels, PerMuscle
from pam_control.laws.law import AnyLaw
from pam_control.learning.motion_learner import MotionLearner
from pam_control.prepared_settings import Loops, PreparedSettings
from pam_control.settings import ControlSettings


@dataclass(frozen=True, slots=True)
class JointSetup:
    """What is in force for one joint until the settings change."""

    law: AnyLaw  # with the values that follow from the size of the joint
    settings: ControlSettings  # the same
    gains: GainSchedule  # of the feedback
    integral_limit: float  # of the feedback, in the unit of its output
    acting_delays: PerMuscle  # time from a control cycle until each valve acts, by the rig file [s]
    margins: list[Margins]  # with these gains, the worst operating point first
    # adapts, learns_flows: whether what is learnt of the torque, and of the flows, is used
    adapts: bool
    learns_flows: bool
    learner: MotionLearner | None  # of a motion that is repeated


def joint_setups(
    joints: Sequence[JointModels], prepared: PreparedSettings, loops: Loops
) -> list[JointSetup]:
    """What is in force for each joint.

    Parameters
    ----------
    prepared : PreparedSettings
        Gives the law and what is learnt.
    loops : Loops
        The normal or the soft ones of it.
    """
    law, session = prepared.law, None if loops.soft else prepared.learning
    setups = []
    for models, margins in zip(joints, loops.margins, strict=True):
        settings = models.scale.complete(loops.settings)
        adapts = settings.adaptation and law.has_adaptation
        limit = settings.integral_limit
        if loops.settings.integral_limit == BY_SIZE and law.largest_integral is not None:
            limit = law.largest_integral
        setups.append(
            JointSetup(
                sized(law, models.scale, settings),
                settings,
                settings.gains[models.name],
                limit,
                models.acting_delays(settings),
                margins,
                adapts,
                # the flows that follow a long unknown delay do not fit the commands, and whatever
                # is learnt of them makes the loops worse
                adapts and not loops.soft,
                session.learners[models.name] if session else None,
            )
        )
    return setups
