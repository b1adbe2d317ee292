"""Watches a running rig and reports on /diagnostics how far it differs from its rig file.

`pam gap monitor --ros-args --params-file config/elbow.yaml`, the same as
`ros2 run pam_gap pam_monitor`.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from pam_gap.live.live_gap import LiveGap, LiveWindow
from pam_gap.live.monitor_help import HELP, PARAMETERS
from pam_gap.recordings.recording import COMMANDS, JOINTS, PRESSURES
from pam_model.errors import PamError
from pam_model.rig import described_key, rig_of_node
from pam_ros.diagnostics import OK, STALE, WARN, diagnostic_array, diagnostic_status
from pam_ros.parameters import NodeParameters
from pam_ros.spin import spin_node
from pam_ros.steady_timers import SteadyTimers
from pam_ros.subscriptions import subscribe
from pam_ros.valve_command import ValveCommandFormat

_SENSED = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
NAME = "pam_gap"


class MonitorNode(Node):  # type: ignore[misc]
    """Connects topics and diagnostics to a LiveWindow."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        self._declared = NodeParameters(
            self, PARAMETERS, rig_of_node, describe=described_key, usual_name=NAME
        )
        self._rig = self._declared.described
        self._window = LiveWindow(self._rig, self._declared.number("window"))
        self._messages = 0
        self._command_format = ValveCommandFormat(self._rig.valve_kinds)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        subscribe(self, JointState, "valve_commands", self._take_commands, _SENSED)
        subscribe(self, JointState, "pressure_states", self._take_pressures, _SENSED)
        subscribe(self, JointState, "joint_states", self._take_positions, _SENSED)
        self.steady_timers = SteadyTimers()
        self.steady_timers.add(self._declared.number("period"), self._report)

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _stamp(self, message: Any) -> float:
        stamp = message.header.stamp
        seconds = float(stamp.sec) + 1e-9 * float(stamp.nanosec)
        return seconds if seconds > 0.0 else self._now()

    def _take_commands(self, message: Any) -> None:
        self._messages += 1
        commands = self._command_format.known(message.name, message.position, message.effort)
        self._window.take(COMMANDS, self._stamp(message), [*commands], [*commands.values()])

    def _take_pressures(self, message: Any) -> None:
        self._messages += 1
        self._window.take(PRESSURES, self._stamp(message), message.name, message.effort)

    def _take_positions(self, message: Any) -> None:
        self._messages += 1
        self._window.take(JOINTS, self._stamp(message), message.name, message.position)

    def _report(self) -> None:
        messages, self._messages = self._messages, 0
        if not messages:
            self._window.forget()
        statuses = [self._status(self._window.gap(i)) for i in range(len(self._rig.joints))]
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(
            diagnostic_array(stamp, *statuses, namespace=self.get_namespace())
        )

    def _status(self, gap: LiveGap) -> Any:
        name = f"{self.get_name()}: {gap.joint}"
        if gap.problem:
            return diagnostic_status(name, STALE, gap.problem, {})
        values: dict[str, object] = {}
        for figure in gap.figures:
            values[f"{figure.channel} {figure.horizon} [{figure.unit}]"] = figure.error
            values[f"{figure.channel} {figure.horizon} noise [{figure.unit}]"] = figure.floor
        for stage, ratio in (gap.stages or {}).items():
            values[f"stage {stage} [times the noise]"] = ratio
        values["worst [times the noise]"] = gap.worst
        large = gap.worst > self._declared.number("warning_ratio")
        text = f"gap {gap.worst:.1f} times the noise"
        if gap.stage:
            text += f", largest at the {gap.stage} stage"
        return diagnostic_status(name, WARN if large else OK, text, values)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    # the first report may compile the simulation, which takes longer than anyone waits for an end
    return spin_node(MonitorNode, HELP, arguments, mistake=PamError, may_be_left=True)


if __name__ == "__main__":
    sys.exit(main())
