"""Draws the messages of a robot's topics, around the names of its rig, and their bytes."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pam_check.fuzz.message_bytes import drawn, spoilt
from pam_check.fuzz.random_targets import injection, names, numbers
from pam_model.rig import Rig
from pam_ros.message_decoder import encode

_SECONDS = (0, 0, 1, -1, -(2**31), 2**31 - 1)
_NANOSECONDS = (0, 1, 999_999_999, 10**9, 2**32 - 1)


class Messages:
    """Draws messages by type, around the names of a rig."""

    def __init__(self, rig: Rig, draw: random.Random) -> None:
        self._draw = draw
        self._names = (rig.joint_names, rig.muscle_names)
        self._by_type: dict[type, Callable[[], Any]] = {
            JointState: self._joint_state,
            JointTrajectory: self._trajectory,
            Float64MultiArray: lambda: Float64MultiArray(data=self._numbers()),
            String: lambda: String(data=injection(draw)),
            DiagnosticStatus: self._status,
        }

    def _status(self) -> Any:
        """A driver's state, with keys and states that may be unknown, missing or doubled."""
        draw = self._draw
        keys, states = (
            ("state", "reason", "", "STATE"),
            ("active", "ready", "fault", "", "nonsense"),
        )
        return DiagnosticStatus(
            values=[
                KeyValue(key=draw.choice(keys), value=draw.choice(states))
                for _ in range(draw.randrange(5))
            ]
        )

    def message(self, kind: type) -> Any:
        """One of this type, around the names of the rig or with any values."""
        if kind not in self._by_type or self._draw.random() < 0.2:
            return drawn(kind, self._draw)
        return self._by_type[kind]()

    def data(self, kind: type) -> bytes:
        """The bytes of a message of this type, every other time spoilt."""
        data = encode(self.message(kind))
        return data if self._draw.random() < 0.5 else spoilt(data, self._draw)

    def _numbers(self) -> list[float]:
        return numbers(self._draw, len(self._draw.choice(self._names)))

    def _some(self) -> list[float]:
        return self._numbers() if self._draw.random() < 0.6 else []

    def _stamp(self, stamp: Any) -> None:
        draw = self._draw
        if draw.random() < 0.5:
            now = time.time_ns() + round(1e9 * draw.choice((0.0, -0.01, -1.0, 1.0)))
            stamp.sec, stamp.nanosec = divmod(now, 10**9)
        else:
            stamp.sec, stamp.nanosec = draw.choice(_SECONDS), draw.choice(_NANOSECONDS)

    def _joint_state(self) -> Any:
        message = JointState(name=names(self._draw, self._draw.choice(self._names)))
        message.position, message.velocity = self._some(), self._some()
        message.effort = self._some()
        self._stamp(message.header.stamp)
        return message

    def _trajectory(self) -> Any:
        draw = self._draw
        message = JointTrajectory(joint_names=names(draw, self._names[0]))
        self._stamp(message.header.stamp)
        for place in range(draw.randrange(4)):
            point = JointTrajectoryPoint()
            point.positions, point.velocities = self._some(), self._some()
            point.accelerations = self._some()
            duration = point.time_from_start
            if draw.random() < 0.7:
                duration.nanosec = 100_000_000 * (place + 1)
            else:
                duration.sec, duration.nanosec = draw.choice(_SECONDS), draw.choice(_NANOSECONDS)
            message.points.append(point)
        return message
