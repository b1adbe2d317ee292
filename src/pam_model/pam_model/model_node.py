"""Node that estimates and publishes muscle forces, joint torques and stiffness.

`pam model node --ros-args --params-file config/elbow.yaml`
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
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from pam_model.errors import PamError
from pam_model.joints.joint_estimator import JointEstimator
from pam_model.model_help import HELP, PARAMETERS
from pam_model.rig import described_key, rig_of_node
from pam_model.robot import compose
from pam_ros.diagnostics import OK, STALE, WARN, diagnostic_array, diagnostic_status
from pam_ros.joint_state_bytes import JointStateFields, JointStateReader
from pam_ros.joint_state_publisher import Audience, JointStatePublisher, nanoseconds_of
from pam_ros.parameters import NodeParameters
from pam_ros.polled_topic import PolledTopic
from pam_ros.spin import spin_node

# Measurements are taken before every estimate, and at least so often, so that none is lost [Hz].
_POLL_RATE = 100.0
NAME = "pam_model"


class ModelNode(Node):  # type: ignore[misc]
    """ROS interface of a JointEstimator: subscriptions, publishers and parameters.

    Parameters
    ----------
    composed : bool, optional
        Whether a program that has the measurements calls `take` and `publish`, in place of
        subscriptions and timers of this node.
    arguments : sequence of str, optional
        Arguments for this node alone, from `--ros-args` on.

    Attributes
    ----------
    publish_rate : float
        Estimates per second [Hz].
    """

    def __init__(self, *, composed: bool = False, arguments: Sequence[str] = ()) -> None:
        super().__init__(
            NAME,
            cli_args=list(arguments) or None,
            automatically_declare_parameters_from_overrides=True,
        )
        self._declared = NodeParameters(
            self, PARAMETERS, rig_of_node, self._change, describe=described_key, usual_name=NAME
        )
        self.rig = self._declared.described
        self._estimator = JointEstimator(
            compose(self.rig),
            self._declared.number("max_age"),
            closed_chambers=bool(self._declared["closed_chambers"]),
        )
        self._messages = 0
        self._joints, self._muscles = self.rig.joint_names, self.rig.muscle_names
        self._muscle_states = JointStatePublisher(self, "muscle_states", 1)
        self._joint_estimates = JointStatePublisher(self, "joint_estimates", 1)
        self._joint_stiffness = self.create_publisher(Float64MultiArray, "joint_stiffness", 1)
        self._stiffness_heard = Audience(self._joint_stiffness).present
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.publish_rate = self._declared.number("publish_rate")
        self.polled_topics: list[PolledTopic] = []
        if not composed:
            self._subscribe()
        self.create_timer(1.0, self._report)

    def _subscribe(self) -> None:
        self.polled_topics = [
            PolledTopic(self, JointState, topic, take, read=JointStateReader().read)
            for topic, take in (
                ("pressure_states", self._take_pressures),
                ("joint_states", self._take_positions),
            )
        ]
        self.create_timer(1.0 / self.publish_rate, self._poll_and_publish)
        if self.publish_rate < _POLL_RATE:
            self.create_timer(1.0 / _POLL_RATE, self._poll)

    def _change(self, changes: Any) -> None:
        self._estimator.max_age = float(changes["max_age"])

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _poll(self) -> None:
        for topic in self.polled_topics:
            topic.poll()

    def _stamp(self, message: JointStateFields) -> float:
        return message.stamp if message.stamp > 0.0 else self._now()

    def _take_pressures(self, message: JointStateFields) -> None:
        self._messages += 1
        self._estimator.take_pressures(self._stamp(message), message.name, message.effort)

    def _take_positions(self, message: JointStateFields) -> None:
        self._messages += 1
        self._estimator.take_positions(
            self._stamp(message), message.name, message.position, message.velocity
        )

    def take(
        self,
        stamps: tuple[float, float],
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
    ) -> None:
        """Take measurements without a message.

        Parameters
        ----------
        stamps : tuple of float
            Of pressures and of angles, wall clock [s]; 0 means now.
        pressures : sequence of float
            By muscle of the rig [Pa gauge].
        positions, velocities : sequence of float
            By joint of the rig [rad], [rad/s].
        """
        self._messages += 1
        of_pressures, of_joints = (stamp or self._now() for stamp in stamps)
        self._estimator.take_pressures(of_pressures, self._muscles, pressures)
        self._estimator.take_positions(of_joints, self._joints, positions, velocities)

    def _poll_and_publish(self) -> None:
        self._poll()
        self.publish()

    def _heard(self) -> bool:
        topics = (self._muscle_states.heard, self._joint_estimates.heard, self._stiffness_heard)
        return any(heard() for heard in topics)

    def publish(self) -> None:
        """Estimate and publish, while anybody listens."""
        if not self._heard():
            return
        now = self._now()
        estimate = self._estimator.estimate(now)
        # unknown estimates (NaN) are stamped with the present time
        stamp = nanoseconds_of(now if estimate.stamp is None else estimate.stamp)
        self._muscle_states.publish(
            stamp,
            self._muscles,
            estimate.muscle_lengths,
            estimate.muscle_speeds,
            estimate.muscle_forces,
        )
        self._joint_estimates.publish(stamp, self._joints, effort=estimate.joint_torques)
        if self._stiffness_heard():
            self._publish_stiffness(estimate.joint_stiffnesses)

    def _publish_stiffness(self, values: Sequence[float]) -> None:
        stiffness = Float64MultiArray(data=values)
        count = len(values)
        label = "joint: " + ",".join(self._joints)
        stiffness.layout.dim = [MultiArrayDimension(label=label, size=count, stride=count)]
        self._joint_stiffness.publish(stiffness)

    def _report(self) -> None:
        messages, self._messages = self._messages, 0
        problems = self._estimator.estimate(self._now()).problems
        if not messages:
            level, text = STALE, "no measurements arrive"
        elif problems:
            level, text = WARN, problems[0]
        else:
            level, text = OK, "estimating"
        values = {
            "measurements per second": messages,
            "problems": len(problems),
            **{f"problem {index}": line for index, line in enumerate(problems)},
        }
        status = diagnostic_status(f"{self.get_name()}: estimates", level, text, values)
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostic_array(stamp, status, namespace=self.get_namespace()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return spin_node(ModelNode, HELP, arguments, mistake=PamError)


if __name__ == "__main__":
    sys.exit(main())
