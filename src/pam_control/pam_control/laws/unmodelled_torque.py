"""Torque that the model of a joint does not explain: observed, learnt, and of a repeated motion.

The model-based law calls these functions once in every cycle, and adds what they find to the torque
that it asks for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from pam_control.adaptation.stiffness_estimate import StiffnessEstimate
from pam_control.adaptation.torque_adaptation import TorqueAdaptation, TorqueSample
from pam_control.control_step import PlanRequest
from pam_control.feedback.disturbance_observer import (
    AlignedPressures,
    DisturbanceObserver,
    ObserverSettings,
)
from pam_control.joint_models import JointModels, Pair
from pam_control.limited import limited
from pam_control.plan_memory import KEPT_BEFORE_MEASUREMENT

RATE_SPAN: Final = 0.01  # s, over which the rate of the muscles' torque is taken


@dataclass(frozen=True, slots=True)
class Estimates:
    """What is observed and learnt of one joint; each part is changed in place.

    Attributes
    ----------
    observer : DisturbanceObserver
        Of the torque that is lost now.
    aligned : AlignedPressures
        The measured pressures at the time of a position.
    adaptation : TorqueAdaptation
        Of the torque along a motion.
    stiffness : StiffnessEstimate
        Of the numbers of the rig file.
    """

    observer: DisturbanceObserver
    aligned: AlignedPressures
    adaptation: TorqueAdaptation
    stiffness: StiffnessEstimate

    @classmethod
    def of(cls, models: JointModels) -> Estimates:
        """Nothing is known of the joint but its models."""
        robot, joint, dynamics = models.robot, models.joint, models.dynamics
        inertia, damping = dynamics.moving_torque(0.0, 1.0), dynamics.moving_torque(1.0, 0.0)
        return cls(
            DisturbanceObserver(inertia, damping, models.pressure_lag),
            AlignedPressures(models.position_delay + KEPT_BEFORE_MEASUREMENT),
            TorqueAdaptation(inertia, damping, models.scale.torque, models.turn),
            StiffnessEstimate(
                robot.rig,
                robot.rig.joints[joint.place],
                models.model,
                dynamics,
                models.scale.torque,
                models.turn + 0.5 / len(robot.joints),
            ),
        )

    def rest(self) -> None:
        """The joint is taken over; what was learnt stays."""
        self.observer.reset()
        self.aligned.reset()
        self.adaptation.restart()
        self.stiffness.restart()

    def forget(self) -> None:
        """What was learnt is forgotten."""
        self.adaptation.forget()
        self.stiffness.forget()


def lost_torque(
    models: JointModels, estimates: Estimates, request: PlanRequest, added: float
) -> float | None:
    """Torque of the muscles that the model does not explain [N m]; None without the observer."""
    settings, bandwidth = request.settings, request.gains.observer
    if bandwidth == 0.0:
        return None
    estimates.aligned.add(request.measured_at, request.pressures)
    position, speed, _ = request.motion
    muscles = models.model.torque(*estimates.aligned.at(request.seen.time), models.inside(position))
    needed = models.dynamics.static_torque(position, speed)
    how = ObserverSettings(bandwidth, settings.derivative_filter, settings.observer_limit)
    return estimates.observer.update(request.fresh, muscles + added, needed, speed, how)


def learn_torque(
    models: JointModels, estimates: Estimates, before: Pair, request: PlanRequest, known: float
) -> tuple[Pair, float]:
    """Take what the torque of the muscles says about what the model lacks.

    Parameters
    ----------
    models, estimates, request
        Of the joint in the present cycle.
    before : (float, float)
        What was returned as `lagging` in the cycle before.
    known : float
        Known torque of hysteresis, creep and dry friction at the time of the position [N m].

    Returns
    -------
    lagging : (float, float)
        Position [rad] and speed [rad/s] with the lag of the pressure sensors.
    learnt : float
        What was learnt now and the integral has carried until now [N m].
    """
    estimates.aligned.add(request.measured_at, request.pressures)
    position, speed = lagging = _lagging(models, before, request)
    inside = models.inside(position)
    # by the rig file, without the learnt delay
    seen_at = request.seen.time + max(estimates.adaptation.delay, 0.0)
    aligned = estimates.aligned.at(seen_at)
    muscles, earlier = models.model.torques(
        (aligned, estimates.aligned.at(seen_at - RATE_SPAN)), inside
    )
    model = models.dynamics.static_torque(position, speed)
    sample = TorqueSample(
        unexplained=muscles + known - model,
        rate=(muscles - earlier) / RATE_SPAN,
        position=position,
        speed=speed,
        speed_filter=request.settings.derivative_filter,
    )
    beside = known - model + models.dynamics.gravity(position)
    estimates.stiffness.learn(request.fresh, aligned, inside, beside)
    return lagging, estimates.adaptation.learn(request.fresh, sample)


def _lagging(models: JointModels, before: Pair, request: PlanRequest) -> Pair:
    """Position [rad] and speed [rad/s] with the lag of the pressure sensors, so that both fit."""
    (position, speed), motion, lag = before, request.motion, models.pressure_lag
    if lag == 0.0 or math.isnan(position):
        return motion.position, motion.velocity
    weight = request.fresh / (lag + request.fresh)
    return (
        position + weight * (motion.position - position),
        speed + weight * (motion.velocity - speed),
    )


def repeated_torque(request: PlanRequest, usual: float) -> tuple[float, float]:
    """The torque of the adaptation and the learnt correction for a repeated motion [N m].

    Parameters
    ----------
    request : PlanRequest
        The present cycle.
    usual : float
        What the adaptation adds [N m].
    """
    learner, at, seen = request.learner, request.measured_at, request.seen.reference
    if learner is None:
        return usual, 0.0
    base, correction = learner.torque(at, usual)
    limit = request.settings.adaptation_limit
    learner.record(at, seen.position - request.motion.position, base, seen.position)
    return base, limited(correction, -limit, limit)
