"""One joint inside a controller: its models, its memory between two steps, what it did last."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from pam_control.compensation.history_torque import HistoryTorque
from pam_control.compensation.inverse_dynamics import InverseDynamics
from pam_control.feedback.gain_design import Margins
from pam_control.feedback.pid import Pid
from pam_control.feedback.pressure_loop import create_pressure_loop, valve_time_constant
from pam_control.references.trajectory import JointReference
from pam_model.effects import effect_value
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.rig import Joint, Rig

Pair = tuple[float, float]

REMEMBERED = 160  # plans: more than any delay a rig file may name is long


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
            effect_value(muscle.effects, "command_delay", "delay") for muscle in self.muscles
        )
        # a lag well above the pressure loop's crossover acts as a delay
        self.pressure_lags = tuple(
            effect_value(muscle.effects, "pressure_lag", "time_constant") for muscle in self.muscles
        )
        self.position_delay = effect_value(joint.effects, "position_delay", "delay")
        self.pid = Pid()
        self.loops = tuple(
            create_pressure_loop(rig, muscle, gas_space)
            for muscle, gas_space in zip(
                self.muscles, (self.model.agonist, self.model.antagonist), strict=True
            )
        )
        self.telemetry = JointTelemetry()
        self.margins: list[Margins] = []
        # of the feedforward, oldest first: time of action, pressures, stiffness, what the
        # muscles' memory adds to the torque
        self.plans: deque[tuple[float, Pair, float, float]] = deque(maxlen=REMEMBERED)
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

    def plan_at(self, time: float) -> tuple[Pair, float, float]:
        """Feedforward pressures [Pa], stiffness [N m/rad] and memory's torque [N m] at `time`."""
        later = self.plans[-1]
        for entry in reversed(self.plans):
            if entry[0] <= time:
                span = later[0] - entry[0]
                part = min((time - entry[0]) / span, 1.0) if span > 0.0 else 0.0
                return (
                    (
                        entry[1][0] + part * (later[1][0] - entry[1][0]),
                        entry[1][1] + part * (later[1][1] - entry[1][1]),
                    ),
                    entry[2] + part * (later[2] - entry[2]),
                    entry[3] + part * (later[3] - entry[3]),
                )
            later = entry
        return later[1], later[2], later[3]
