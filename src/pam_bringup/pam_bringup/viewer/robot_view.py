"""Turns the messages of a robot into what the viewer shows; knows neither ROS nor the viewer.

A message is anything with the fields of the ROS message, so that a running robot and a recording
are shown by the same code.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any, Protocol

from pam_bringup.viewer.arm_drawing import Stroke, arm_strokes
from pam_gap.live.live_gap import LiveWindow
from pam_gap.recordings.recording import COMMANDS, JOINTS, PRESSURES
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_ros.foreign_text import SENTENCE, plain
from pam_ros.valve_command import FLOW, ValveCommandFormat

TOPICS = {
    "joint_states": "sensor_msgs/msg/JointState",
    "pressure_states": "sensor_msgs/msg/JointState",
    "valve_commands": "sensor_msgs/msg/JointState",
    "pam_controller/reference": "sensor_msgs/msg/JointState",
    "pam_controller/error": "sensor_msgs/msg/JointState",
    "pam_controller/stiffness_commands": "std_msgs/msg/Float64MultiArray",
    "joint_stiffness": "std_msgs/msg/Float64MultiArray",
    "pam_driver/state": "diagnostic_msgs/msg/DiagnosticStatus",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""Topics that are shown, with their types; names without `/` are in the robot's namespace."""

FOR_PROGRAMS = ("activation",)  # of the driver's state
SHOW_EVERY = 0.02  # s, between two shown values of a topic
DRAW_EVERY = 0.05  # s, between two drawings of the arm
GAP_EVERY = 2.0  # s
GAP_WINDOW = 6.0  # s
MOST_SHOWN = 100  # warnings, and values of the driver's state
LEVELS = ("ok", "warning", "error", "no data")


class Sink(Protocol):
    """Where the viewer takes what it shows. Times are in s since 1970."""

    def number(self, path: str, time: float, value: float) -> None:
        """A point of a curve."""

    def text(self, path: str, time: float, markdown: str) -> None:
        """A text that replaces the one before."""

    def lines(self, time: float, strokes: Sequence[Stroke]) -> None:
        """Lines of the 3-D view."""


def _of_these(
    known: Collection[str], names: Sequence[str], values: Sequence[float]
) -> Iterator[tuple[str, float]]:
    """The values of these names; each other name would become a curve of its own."""
    return (pair for pair in zip(names, values, strict=False) if pair[0] in known)


class RobotView:
    """Shows the messages of one robot."""

    def __init__(self, rig: Rig, sink: Sink) -> None:
        self._rig, self._sink = rig, sink
        self._robot = compose(rig)
        self._format = ValveCommandFormat(rig.valve_kinds)
        self._window = LiveWindow(rig, GAP_WINDOW)
        self._shown: dict[str, float] = {}
        self._gap_at = math.inf
        self._pressures: dict[str, float] = {}
        self._state = "no message from the driver yet"
        self._warnings: dict[str, str] = {}
        self._asked: list[float] = []

    def take(self, topic: str, time: float, message: Any) -> None:
        """Show a message.

        Parameters
        ----------
        topic : str
            A key of `TOPICS`.
        time : float
            When it was measured or received [s since 1970].
        message : object
            With the fields of the type in `TOPICS`.
        """
        if topic in ("joint_states", "pressure_states", "valve_commands"):
            self._remember(topic, time, message)
        last = self._shown.get(topic, -math.inf)
        if topic not in ("/diagnostics", "pam_driver/state"):
            if 0.0 <= time - last < SHOW_EVERY:
                return
            self._shown[topic] = time
        getattr(self, f"_show_{topic.rsplit('/', 1)[-1]}")(time, message)

    def _remember(self, topic: str, time: float, message: Any) -> None:
        """Keep the values for the gap, and judge it from time to time."""
        prefix = {"joint_states": JOINTS, "pressure_states": PRESSURES}.get(topic, COMMANDS)
        if topic == "valve_commands":
            commands = self._commands(message)
            names, values = list(commands), list(commands.values())
        else:
            names = list(message.name)
            shown = message.effort if topic == "pressure_states" else message.position
            values = [float(value) for value in shown]
        self._window.take(prefix, time, names, values)
        if self._gap_at == math.inf or self._gap_at > time + 10.0 * GAP_EVERY:
            self._gap_at = time + GAP_WINDOW
        if time >= self._gap_at:
            self._gap_at = time + GAP_EVERY
            for place, joint in enumerate(self._rig.joints):
                for stage, ratio in (self._window.gap(place).stages or {}).items():
                    self._number(f"gap/{joint.name}/{stage}", time, ratio)

    def _commands(self, message: Any) -> dict[str, float]:
        return self._format.known(message.name, message.position, message.effort)

    def _number(self, path: str, time: float, value: float) -> None:
        if math.isfinite(value):  # a gap of the curve; one NaN would empty the viewer's plot
            self._sink.number(path, time, float(value))

    def _show_joint_states(self, time: float, message: Any) -> None:
        strokes: list[Stroke] = []
        for name, position in zip(message.name, message.position, strict=False):
            if name in self._rig.joint_names and math.isfinite(position):
                self._number(f"angle/{name}/measured", time, position)
                place = self._rig.joint_names.index(name)
                strokes += arm_strokes(self._robot, place, float(position), self._pressures)
        if strokes and not 0.0 <= time - self._shown.get("arm", -math.inf) < DRAW_EVERY:
            self._shown["arm"] = time
            self._sink.lines(time, strokes)

    def _show_pressure_states(self, time: float, message: Any) -> None:
        muscles = self._rig.muscle_names
        for name, pressure in _of_these(muscles, message.name, message.effort):
            self._pressures[name] = float(pressure)
            self._number(f"pressure/{name}", time, 1e-3 * pressure)

    def _show_valve_commands(self, time: float, message: Any) -> None:
        for name, command in self._commands(message).items():
            if self._rig.valve_kinds[name] == FLOW:
                self._number(f"valve/{name}", time, command)
            else:
                self._number(f"pressure/{name}_asked", time, 1e-3 * command)

    def _show_reference(self, time: float, message: Any) -> None:
        for name, position in _of_these(self._rig.joint_names, message.name, message.position):
            self._number(f"angle/{name}/reference", time, position)

    def _show_error(self, time: float, message: Any) -> None:
        for name, position in _of_these(self._rig.joint_names, message.name, message.position):
            self._number(f"error/{name}", time, 1e3 * position)

    def _show_stiffness_commands(self, time: float, message: Any) -> None:
        self._asked = [float(value) for value in message.data]
        self._stiffness("asked", time, self._asked)

    def _show_joint_stiffness(self, time: float, message: Any) -> None:
        self._stiffness("given", time, [float(value) for value in message.data])
        # A command holds until the next one; a line from command to command would be a ramp.
        self._stiffness("asked", time, self._asked)

    def _stiffness(self, kind: str, time: float, values: Sequence[float]) -> None:
        for name, value in zip(self._rig.joint_names, values, strict=False):
            self._number(f"stiffness/{name}/{kind}", time, value)

    def _show_state(self, time: float, message: Any) -> None:
        told = [entry for entry in message.values if entry.value and entry.key not in FOR_PROGRAMS]
        rows = [f"- {plain(entry.key)}: {plain(entry.value, SENTENCE)}" for entry in told]
        self._state = "\n".join([f"**{plain(message.message, SENTENCE)}**", "", *rows[:MOST_SHOWN]])
        self._tell(time)

    def _show_diagnostics(self, time: float, message: Any) -> None:
        for status in message.status:
            level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
            name = plain(status.name)
            if level == 0:
                self._warnings.pop(name, None)
            elif name in self._warnings or len(self._warnings) < MOST_SHOWN:
                named = LEVELS[min(level, len(LEVELS) - 1)]
                self._warnings[name] = f"- {named}: {name}: {plain(status.message, SENTENCE)}"
        self._tell(time)

    def _tell(self, time: float) -> None:
        lines = [f"# Driver\n\n{self._state}\n\n# Warnings and faults\n"]
        lines += [self._warnings[name] for name in sorted(self._warnings)] or ["none"]
        self._sink.text("driver", time, "\n".join(lines))
