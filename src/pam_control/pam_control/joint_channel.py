"""One joint inside a controller: its models, its state and the telemetry of its last step."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from pam_control.adaptation.stiffness_estimate import StiffnessEstimate
from pam_control.adaptation.torque_adaptation import TorqueAdaptation
from pam_control.compensation.history_torque import HistoryTorque
from pam_control.compensation.inverse_dynamics import InverseDynamics
from pam_control.feedback.disturbance_observer import AlignedPressures, DisturbanceObserver
from pam_control.feedback.margins import Margins
from pam_control.feedback.pid import Pid
from pam_control.feedback.pressure_loop import create_pressure_loop
from pam_control.feedback.stuck_integral import StuckIntegral
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.joint_scale import JointScale
from pam_control.learning.motion_learner import MotionLearner
from pam_control.limited import limited
from pam_control.references.spline import JointReference
from pam_control.settings import ControlSettings
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.robot import Robot, RobotJoint

Pair = tuple[float, float]

# Plans are kept until they are this much older than the last measurement [s]: a rate is computed
# over one control cycle (20 ms at the slowest rate), and measurements may arrive out of order.
KEPT_BEFORE_MEASUREMENT = 0.1
# Of max_pressure, above which the driver vents: pressure loops overshoot by 1 %, and noise adds.
PRESSURE_SHARE = 0.97


@dataclass(slots=True)
class Plan:
    """Desired pressures of the feedforward at one time.

    Attributes
    ----------
    time : float
        Time when the later valve acts [s].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    stiffness : float
        [N m/rad].
    memory_torque : float
        Joint torque of `known`, without what was learnt [N m].
    known : float
        Joint torque due to hysteresis and creep of the muscles and to dry friction [N m].
    """

    time: float
    pressures: Pair
    stiffness: float
    memory_torque: float
    known: float


@dataclass(slots=True)
class JointTelemetry:
    """Telemetry of one joint from the last control step.

    Attributes
    ----------
    reference : JointReference
        Reference at the time of measurement.
    error : float
        Reference minus measured position [rad].
    torque, stiffness : float
        Desired values [N m], [N m/rad].
    torque_reached, stiffness_reached : float
        Values that the desired pressures give [N m], [N m/rad].
    pressures : (float, float)
        Desired gauge pressures [Pa].
    disturbance : float
        Torque on the joint that its model does not explain [N m], observed or learnt; NaN if
        neither is asked for.
    clipped : tuple of str
        What was limited: "torque", "stiffness", "pressure_rate", "valve".
    """

    reference: JointReference = field(default_factory=lambda: JointReference(math.nan))
    error: float = math.nan
    torque: float = math.nan
    stiffness: float = math.nan
    torque_reached: float = math.nan
    stiffness_reached: float = math.nan
    pressures: Pair = (math.nan, math.nan)
    disturbance: float = math.nan
    clipped: tuple[str, ...] = ()


class JointChannel:
    """Models of one joint, and its state between control steps."""

    def __init__(
        self,
        robot: Robot,
        joint: RobotJoint,
        min_pressure: float,
        reservoir: SupplyReservoir | None = None,
    ) -> None:
        self.joint = joint
        self.model = AntagonisticJoint.from_robot(
            robot, joint, min_pressure=min_pressure, pressure_share=PRESSURE_SHARE
        )
        self.dynamics = InverseDynamics.from_joint(joint)
        self.indices = joint.muscles
        self.muscles = tuple(robot.muscles[place] for place in joint.muscles)
        self.history = HistoryTorque(self.muscles, joint.arms[0].length, self.dynamics.dry_friction)
        self.valve_time_constants = tuple(m.valve.time_constant for m in self.muscles)
        self.command_delays = tuple(m.valve.command_delay for m in self.muscles)
        # a lag well above the pressure loop's crossover acts as a delay
        self.pressure_lag = max(m.pressure_lag for m in self.muscles)
        self.position_delay = joint.position_delay
        self.pid = Pid()
        self.observer = DisturbanceObserver(
            self.dynamics.inertia, self.dynamics.viscous_friction, self.pressure_lag
        )
        self.aligned = AlignedPressures(self.position_delay + KEPT_BEFORE_MEASUREMENT)
        self.scale = JointScale.of(joint, self.model)
        turn = joint.place / len(robot.joints)
        self.adaptation = TorqueAdaptation(
            self.dynamics.inertia, self.dynamics.viscous_friction, self.scale.torque, turn
        )
        self.stiffness = StiffnessEstimate(
            robot.rig,
            robot.rig.joints[joint.place],
            self.model,
            self.dynamics,
            self.scale.torque,
            turn + 0.5 / len(robot.joints),
        )
        self.stiffness_goal = self.stiffness_factor = 1.0
        self.corrected_at = -math.inf
        self.stuck = StuckIntegral()
        reservoir = reservoir or SupplyReservoir(robot)
        self.loops = tuple(
            create_pressure_loop(robot, muscle, gas_space, reservoir)
            for muscle, gas_space in zip(
                self.muscles, (self.model.agonist, self.model.antagonist), strict=True
            )
        )
        self.learner: MotionLearner | None = None
        self.adapted = 0.0  # learnt torque of the newest plan [N m]
        self.telemetry = JointTelemetry()
        self.margins: list[Margins] = []
        self.acting_delays: Pair = (0.0, 0.0)  # see the function below; of the present settings
        self.plans: deque[Plan] = deque()  # oldest first
        self.desired: Pair = (math.nan, math.nan)
        self.shown: Pair = (0.0, 0.0)  # plan as sensors with a lag show it [Pa]
        self.position = math.nan
        self.velocity = 0.0
        self.position_time = math.nan
        self._lagging: Pair = (math.nan, math.nan)
        self.valve_clipped = False
        self.yields = False  # its law lets others move the joint: an error is no fault
        self.driven = False  # by torques, so that there is no reference
        self.sinking_from: Pair | None = None  # desired pressures when the lowering began [Pa]
        self.sinking_share = 1.0

    def reset(self) -> None:
        """Reset the state."""
        self.pid.reset()
        self.observer.reset()
        self.aligned.reset()
        self.adaptation.restart()
        self.stiffness.restart()
        self.stuck.reset()
        self.corrected_at = -math.inf
        self.adapted = 0.0
        if self.learner is not None:
            self.learner.interrupt()
        self.plans.clear()
        self.history.reset()
        self.position = self.position_time = math.nan
        self.velocity = 0.0
        self._lagging = (math.nan, math.nan)
        self.valve_clipped = False
        for loop in self.loops:
            loop.reset()

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the joint and its valves."""
        self.adaptation.forget()
        self.stiffness.forget()
        self.stiffness_goal = self.stiffness_factor = 1.0
        self.corrected_at = -math.inf
        for loop in self.loops:
            loop.forget_adaptation()

    @property
    def late_position(self) -> float:
        """By how much more than told the positions are late, as was learnt [s]."""
        return max(self.adaptation.delay, 0.0)

    @property
    def late_pressures(self) -> float:
        """By how much more than told the pressures are late, as was learnt [s]."""
        return max(-self.adaptation.delay, 0.0)

    @property
    def late_commands(self) -> Pair:
        """By how much more than told the command of each valve is late, as was learnt [s].

        A late sensor of the pressure makes the valve seem late.
        """
        pressures = self.late_pressures
        first, second = self.loops
        return max(first.late - pressures, 0.0), max(second.late - pressures, 0.0)

    def inside(self, position: float) -> float:
        """The position [rad] limited to the range of the muscles' models."""
        low, high = self.model.position_range
        return limited(position, low, high)

    def measure(self, position: float, time: float, velocity_filter: float) -> float:
        """Store a measured position; return the time since the last new sample [s], 0 if none."""
        if math.isnan(self.position_time):
            self.position, self.position_time = position, time
            return 0.0
        step = time - self.position_time
        if step <= 0.0:
            return 0.0
        weight = step / (velocity_filter + step)
        self.velocity += weight * ((position - self.position) / step - self.velocity)
        self.position, self.position_time = position, time
        return step

    def lagging(self, step: float) -> Pair:
        """Position [rad] and speed [rad/s] with the lag of the pressure sensors, so that both fit.

        Parameters
        ----------
        step : float
            Time since the last new position [s]; 0 if there is none.
        """
        position, speed = self._lagging
        if self.pressure_lag == 0.0 or math.isnan(position):
            self._lagging = self.position, self.velocity
        else:
            weight = step / (self.pressure_lag + step)
            self._lagging = (
                position + weight * (self.position - position),
                speed + weight * (self.velocity - speed),
            )
        return self._lagging

    def remember(self, plan: Plan, measured_at: float) -> None:
        """Add a plan and delete plans that are too much older than the last measurement [s].

        Plans are deleted by age, not by number, because the delays of sensors and valves are given
        in seconds and the control cycle may be as short as 0.5 ms.
        """
        self.plans.append(plan)
        while len(self.plans) > 2 and self.plans[1].time < measured_at - KEPT_BEFORE_MEASUREMENT:
            self.plans.popleft()

    def planned_rates(self, times: Pair) -> Pair:
        """Rates [Pa/s] of the planned pressures at the time [s] at which each valve acts.

        The rate is the backward difference over the last control cycle. It is 0 if there are fewer
        than two plans or if the last plan is not later than the one before it.
        """
        if len(self.plans) < 2:
            return 0.0, 0.0
        span = self.plans[-1].time - self.plans[-2].time
        if span <= 0.0:
            return 0.0, 0.0
        now = self.pressures_at(times)
        before = self.pressures_at((times[0] - span, times[1] - span))
        return (now[0] - before[0]) / span, (now[1] - before[1]) / span

    def pressures_at(self, times: Pair) -> Pair:
        """Planned pressures [Pa] at the time [s] of each muscle."""
        first, second = times
        pressures = self.plan_at(first).pressures
        if second == first:
            return pressures
        return pressures[0], self.plan_at(second).pressures[1]

    def shown_plan(self, time: float, step: float) -> Pair:
        """Planned pressures [Pa] that sensors show which lag behind `time` [s] by their lag."""
        if self.pressure_lag == 0.0:
            return self.plan_at(time).pressures
        weight = step / (self.pressure_lag + step)
        first, second = self.plan_at(time + self.pressure_lag).pressures
        self.shown = (
            self.shown[0] + weight * (first - self.shown[0]),
            self.shown[1] + weight * (second - self.shown[1]),
        )
        return self.shown

    def plan_at(self, time: float) -> Plan:
        """Plan for `time` [s]: linear interpolation between the plans, constant outside them.

        After the last plan it is that plan itself, with its own time.
        """
        later = self.plans[-1]
        if later.time <= time:
            return later
        for earlier in reversed(self.plans):
            if earlier.time <= time:
                span = later.time - earlier.time
                part = min((time - earlier.time) / span, 1.0) if span > 0.0 else 0.0
                (a, b), (next_a, next_b) = earlier.pressures, later.pressures
                return Plan(
                    time,
                    (a + part * (next_a - a), b + part * (next_b - b)),
                    earlier.stiffness + part * (later.stiffness - earlier.stiffness),
                    earlier.memory_torque + part * (later.memory_torque - earlier.memory_torque),
                    earlier.known + part * (later.known - earlier.known),
                )
            later = earlier
        return later


def acting_delays(channel: JointChannel, settings: ControlSettings) -> Pair:
    """Time from a control cycle until each of a joint's valves acts, as the rig file tells [s]."""
    soon = settings.command_delay + 0.5 * settings.period
    first, second = (
        soon + settings.lead_ratio * lag + delay
        for lag, delay in zip(channel.valve_time_constants, channel.command_delays, strict=True)
    )
    return first, second
