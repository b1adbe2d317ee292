"""One joint inside a controller: its models, its memory between two steps, what it did last."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from pam_control.compensation.history_torque import HistoryTorque
from pam_control.compensation.inverse_dynamics import InverseDynamics
from pam_control.feedback.margins import Margins
from pam_control.feedback.pid import Pid
from pam_control.feedback.pressure_loop import create_pressure_loop, valve_time_constant
from pam_control.references.trajectory import JointReference
from pam_model.effects import adjusted
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.rig import Joint, Rig

Pair = tuple[float, float]

# Plans older than the last measurement are kept this long [s]: a rate is taken over one control
# cycle (20 ms at the slowest rate), and a measurement may come out of order.
KEPT_BEFORE_MEASUREMENT = 0.1


@dataclass(frozen=True, slots=True)
class Plan:
    """What the feedforward wants at one time.

    Attributes
    ----------
    time : float
        When the later valve acts on it [s].
    pressures : (float, float)
        Agonist, antagonist, gauge [Pa].
    stiffness : float
        [N m/rad].
    memory_torque : float
        What hysteresis and creep of the muscles add to the joint's torque [N m].
    """

    time: float
    pressures: Pair
    stiffness: float
    memory_torque: float


@dataclass(slots=True)
class JointTelemetry:
    """What the controller did with one joint in its last step.

    Attributes
    ----------
    reference : JointReference
        At the time of measurement.
    error : float
        Reference less measured position [rad].
    torque, stiffness : float
        Asked for [N m], [N m/rad].
    torque_reached, stiffness_reached : float
        What the desired pressures give.
    pressures : (float, float)
        Desired, gauge [Pa].
    clipped : tuple of str
        Among "torque", "stiffness", "pressure_rate", "valve".
    """

    reference: JointReference = field(default_factory=lambda: JointReference(math.nan))
    error: float = math.nan
    torque: float = math.nan
    stiffness: float = math.nan
    torque_reached: float = math.nan
    stiffness_reached: float = math.nan
    pressures: Pair = (math.nan, math.nan)
    clipped: tuple[str, ...] = ()


class JointChannel:
    """One joint's models and its memory between steps."""

    def __init__(self, rig: Rig, joint: Joint, min_pressure: float) -> None:
        self.joint = joint
        self.model = AntagonisticJoint.from_rig(rig, joint.name, min_pressure=min_pressure)
        self.dynamics = InverseDynamics.from_joint(joint)
        self.muscles = tuple(rig.muscle(name) for name in joint.muscles)
        self.indices = tuple(rig.muscle_names.index(name) for name in joint.muscles)
        self.history = HistoryTorque(self.muscles, self.model.pulley_radius)
        self.valve_time_constants = tuple(valve_time_constant(m) for m in self.muscles)
        self.command_delays = tuple(
            adjusted("valve.command_delay", None, muscle.effects) for muscle in self.muscles
        )
        # a lag well above the pressure loop's crossover acts as a delay
        self.pressure_lags = tuple(
            adjusted("pressure_sensor.lag", None, muscle.effects) for muscle in self.muscles
        )
        self.position_delay = adjusted("position_sensor.delay", None, joint.effects)
        self.pid = Pid()
        self.loops = tuple(
            create_pressure_loop(rig, muscle, gas_space)
            for muscle, gas_space in zip(
                self.muscles, (self.model.agonist, self.model.antagonist), strict=True
            )
        )
        self.telemetry = JointTelemetry()
        self.margins: list[Margins] = []
        self.plans: deque[Plan] = deque()  # oldest first
        self.desired: Pair = (math.nan, math.nan)
        self.position = math.nan
        self.velocity = 0.0
        self.position_time = math.nan
        self.valve_clipped = False

    def reset(self) -> None:
        """Forget all motion."""
        self.pid.reset()
        self.plans.clear()
        self.history.reset()
        self.position = self.position_time = math.nan
        self.velocity = 0.0
        self.valve_clipped = False
        for loop in self.loops:
            loop.reset()

    def inside(self, position: float) -> float:
        """The position [rad] cut to what the muscles' models cover."""
        low, high = self.model.position_range
        return max(low, min(high, position))

    def measure(self, position: float, time: float, velocity_filter: float) -> float:
        """Take a position; seconds since the last new one, 0 when it is the same sample."""
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

    def remember(self, plan: Plan, measured_at: float) -> None:
        """Add a plan and forget those that lie too far before the last measurement [s].

        Plans are forgotten by their age, not by their number: the delays of sensors and valves
        are given in seconds, and the control cycle may be as short as 0.5 ms.
        """
        self.plans.append(plan)
        while len(self.plans) > 2 and self.plans[1].time < measured_at - KEPT_BEFORE_MEASUREMENT:
            self.plans.popleft()

    def planned_rates(self, times: Pair) -> Pair:
        """Rates [Pa/s] of the planned pressures at the time [s] at which each valve acts.

        The rate is the backward difference over the last control cycle. 0 until there are two
        plans, and where the last one does not lie after the one before it.
        """
        if len(self.plans) < 2:
            return 0.0, 0.0
        span = self.plans[-1].time - self.plans[-2].time
        if span <= 0.0:
            return 0.0, 0.0
        rates = [
            (self.plan_at(time).pressures[side] - self.plan_at(time - span).pressures[side]) / span
            for side, time in enumerate(times)
        ]
        return rates[0], rates[1]

    def plan_at(self, time: float) -> Plan:
        """The feedforward's plan for `time` [s], linear between two plans, held outside them."""
        later = self.plans[-1]
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
                )
            later = earlier
        return later
