"""Publishes the muscles as markers, for RViz and Foxglove, together with the model of the robot.

`pam bringup markers --ros-args --params-file config/elbow.yaml`
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import math
import sys
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from pam_bringup.viewer.arm_drawing import Stroke, arm_strokes
from pam_bringup.viewer.markers_help import HELP, PARAMETERS
from pam_model.errors import PamError
from pam_model.rig import described_key, rig_of_node
from pam_model.robot import compose
from pam_ros.parameters import NodeParameters
from pam_ros.spin import spin_node
from pam_ros.subscriptions import subscribe

LINK = "link"  # the rod of a joint, which the robot's own model shows
_LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def cylinder(stroke: Stroke, number: int, frame: str) -> Marker:
    """A vertical stroke as a marker; its stamp of zero means the newest transform."""
    (x, y, top), (_, _, bottom) = stroke.points
    marker = Marker(ns=stroke.name, id=number, type=Marker.CYLINDER, action=Marker.ADD)
    marker.header.frame_id = frame
    position, size, colour = marker.pose.position, marker.scale, marker.color
    position.x, position.y, position.z = x, y, 0.5 * (top + bottom)
    size.x = size.y = 2.0 * stroke.radius
    size.z = abs(top - bottom)
    colour.r, colour.g, colour.b = (part / 255.0 for part in stroke.colour)
    colour.a = 1.0
    return marker


NAME = "pam_markers"


class MarkersNode(Node):  # type: ignore[misc]
    """Draws the muscles of every joint whose angle is measured."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        self._declared = NodeParameters(
            self, PARAMETERS, rig_of_node, describe=described_key, usual_name=NAME
        )
        self._robot = compose(self._declared.described)
        self._frame = str(self._declared["frame"])
        self._positions: dict[str, float] = {}
        self._pressures: dict[str, float] = {}
        self._markers = self.create_publisher(MarkerArray, "~/muscles", 1)
        subscribe(self, JointState, "joint_states", self._take_positions, _LATEST)
        subscribe(self, JointState, "pressure_states", self._take_pressures, _LATEST)
        self.create_timer(1.0 / self._declared.number("rate"), self._publish)

    def _take_positions(self, message: JointState) -> None:
        self._positions = dict(zip(message.name, message.position, strict=False))

    def _take_pressures(self, message: JointState) -> None:
        self._pressures = dict(zip(message.name, message.effort, strict=False))

    def _publish(self) -> None:
        markers = []
        for place, name in enumerate(self._robot.joint_names):
            position = self._positions.get(name, math.nan)
            if math.isfinite(position):
                strokes = arm_strokes(self._robot, place, position, self._pressures)
                shown = [stroke for stroke in strokes if not stroke.name.endswith(f"/{LINK}")]
                markers += [cylinder(stroke, 0, self._frame) for stroke in shown]
        if markers:
            self._markers.publish(MarkerArray(markers=markers))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return spin_node(MarkersNode, HELP, arguments, mistake=PamError)


if __name__ == "__main__":
    sys.exit(main())
