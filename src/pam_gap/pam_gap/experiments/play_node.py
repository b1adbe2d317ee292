"""Plays a proposed experiment on the rig in place of the controller.

`pam gap play --ros-args --params-file RIG -p experiment:=OUT/next_experiment`

The driver must be active and no controller may run. First the joint moves to the state in which the
experiment begins. At the end both muscles are vented and the node ends. The muscles of other joints
keep their air.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from pam_gap.experiments.files import read_experiment
from pam_gap.experiments.loop import ExperimentLoop, holding_commands
from pam_gap.experiments.play_help import HELP, PARAMETERS
from pam_model.errors import PamError
from pam_model.rig import described_key, rig_of_node
from pam_ros.parameters import NodeParameters
from pam_ros.periodic import PeriodicLoop
from pam_ros.spin import spin_node
from pam_ros.subscriptions import subscribe
from pam_ros.valve_command import ValveCommandFormat

_SENSED = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
VENT_TIME = 1.0  # s, of venting at the end
NAME = "pam_play"


class PlayNode(Node):  # type: ignore[misc]
    """Connects measurements and valve commands to an ExperimentLoop."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        parameters = NodeParameters(
            self,
            PARAMETERS,
            rig_of_node,
            describe=described_key,
            usual_name=NAME,
            keeps_real_time=True,
        )
        self._rig = rig = parameters.described
        name = str(parameters["joint"]) or rig.joint_names[0]
        if name not in rig.joint_names:
            raise PamError(f"joint = {name!r}: must be one of {', '.join(rig.joint_names)}")
        joint = list(rig.joint_names).index(name)
        self._joint = rig.joints[joint]
        self._muscle_names = list(rig.muscle_names)
        self._command_format = ValveCommandFormat(rig.valve_kinds)
        self._held = holding_commands(rig, {})
        self._excitation = read_experiment(Path(str(parameters["experiment"])))
        self._loop = ExperimentLoop(rig, joint, self._excitation)
        self._approach = parameters.number("approach")
        self._max_age = parameters.number("max_age")
        self._position, self._position_at = 0.0, -math.inf
        self._pressures: dict[str, float] = {}
        self._pressures_at = -math.inf
        self._begin = math.inf
        self._problem = ""
        self.done = False
        self._commands = self.create_publisher(JointState, "valve_commands", QoSProfile(depth=1))
        subscribe(self, JointState, "joint_states", self._take_positions, _SENSED)
        subscribe(self, JointState, "pressure_states", self._take_pressures, _SENSED)
        self.loop = PeriodicLoop(self._cycle, 1.0 / parameters.number("rate"), "play")
        self.loop.start()

    @staticmethod
    def _now() -> float:
        """By the monotonic clock: an age must not depend on the wall clock, which can be set."""
        return time.monotonic()

    def _take_positions(self, message: Any) -> None:
        positions = dict(zip(message.name, message.position, strict=False))
        if self._joint.name in positions:
            self._position = float(positions[self._joint.name])
            self._position_at = self._now()

    def _take_pressures(self, message: Any) -> None:
        self._pressures = dict(zip(message.name, message.effort, strict=False))
        self._pressures_at = self._now()

    def _cycle(self, _: float) -> None:
        now = self._now()
        pressures = [self._pressures.get(m, math.nan) for m in self._joint.muscles]
        fresh = now - min(self._position_at, self._pressures_at) < self._max_age
        known = fresh and all(math.isfinite(x) for x in (self._position, *pressures))
        if math.isinf(self._begin):
            if not known:
                return
            self._begin = now + self._approach
            self._held = holding_commands(self._rig, self._pressures)
            self.get_logger().info(f"{self._excitation.name}: {self._excitation.instruction}")
        at = now - self._begin
        if not known and not self._problem:
            self._problem = "measurements are missing or too old; the muscles were vented"
            self._begin = now - self._excitation.duration
            at = self._excitation.duration
        if at < self._excitation.duration and not self._problem:
            self._send(self._loop.commands(at, self._position, pressures))
        elif at < self._excitation.duration + VENT_TIME:
            vented = dict(zip(self._muscle_names, self._command_format.vented, strict=True))
            self._send([vented[muscle] for muscle in self._joint.muscles])
        else:
            self.done = True

    def _send(self, commands: Sequence[float]) -> None:
        """Send commands for the joint's muscles; those of other joints keep their air."""
        whole = list(self._held)
        for muscle, value in zip(self._joint.muscles, commands, strict=True):
            whole[self._muscle_names.index(muscle)] = value
        message = JointState(name=self._muscle_names)
        message.position, message.effort = self._command_format.pack(whole)
        message.header.stamp = self.get_clock().now().to_msg()
        self._commands.publish(message)

    def check(self) -> None:
        """End the process when the experiment has ended.

        Raises
        ------
        PamError
            When the experiment ended early.
        """
        self.loop.check()
        if self.done:
            self.loop.stop()
            if self._problem:
                raise PamError(self._problem)
            rclpy.try_shutdown()


def main(arguments: Sequence[str] | None = None) -> int:
    """Play the experiment until it ends or a signal arrives."""
    return spin_node(PlayNode, HELP, arguments, lambda node: node.check(), mistake=PamError)


if __name__ == "__main__":
    sys.exit(main())
