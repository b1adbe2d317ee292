"""A simulated rig on a CAN bus as a ROS node, which also publishes the true state on topics.

`pam sim node --ros-args --params-file config/elbow.yaml -p bus.interface:=udp_multicast
-p bus.channel:=239.74.163.2`
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
from rclpy.time import Time
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import String
from std_srvs.srv import Trigger

from pam_driver.buses import OnlyBus, open_buses
from pam_driver.driver_parameters import bus_options
from pam_model.errors import PamError
from pam_model.rig import described_key, rig_of_node
from pam_ros.diagnostics import OK, WARN, diagnostic_array, diagnostic_status
from pam_ros.foreign_text import shown
from pam_ros.joint_state_publisher import Audience, JointStatePublisher, nanoseconds_of
from pam_ros.parameters import NodeParameters
from pam_ros.spin import spin_node
from pam_ros.steady_timers import SteadyTimers
from pam_ros.subscriptions import subscribe
from pam_sim.rig import parse_effects, simulated_rig
from pam_sim.rig_help import HELP, PARAMETERS
from pam_sim.rig_loop import RigLoop

NAME = "pam_rig"


class RigNode(Node):  # type: ignore[misc]
    """Publishes the true state of a RigLoop and injects faults on request."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        values = NodeParameters(
            self, PARAMETERS, rig_of_node, describe=described_key, usual_name=NAME
        )
        self._rig = values.described
        hidden = str(values["hidden_effects"]).replace(",", " ").split()
        simulated = simulated_rig(
            self._rig,
            values.number,
            parse_effects(hidden, "hidden_effects"),
            true_rig=str(values["true_rig"]),
            dbc=str(values["bus.dbc"]),
            firmware=str(values["firmware"]),
        )
        options = bus_options(str(values["bus.options"]))
        interface = str(values["bus.interface"])
        if interface == "udp_multicast":
            options["port"] = values["bus.port"]
        only = OnlyBus(interface, str(values["bus.channel"]), None, options)
        ports = open_buses(self._rig, simulated.wiring, only)
        truth_rate = values.number("ground_truth_rate")
        self._loop = RigLoop(
            simulated,
            ports,
            values.number("rate"),
            truth_rate,
            int(values.number("realtime_priority")),
        )
        self._loop.schedule(str(values["faults"]))
        self._skipped = 0.0
        topics = [
            JointStatePublisher(self, f"ground_truth/{name}", 1)
            for name in ("joint_states", "muscle_states", "pressure_states")
        ]
        self._joints, self._muscles, self._pressures = topics
        self._supply = self.create_publisher(FluidPressure, "ground_truth/supply_pressure", 1)
        self._supply_heard = Audience(self._supply).present
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        subscribe(self, String, "~/inject_fault", self._on_fault, 10)
        self.create_service(Trigger, "~/mend_faults", self._on_mend)
        self.steady_timers = SteadyTimers()
        self.steady_timers.add(1.0 / truth_rate, self._publish)
        self.steady_timers.add(1.0, self._report)
        self.get_logger().info("loading the plant; the first start compiles it (up to a minute)")
        self._loop.start()
        names = ", ".join(port.name for port in ports.values())
        self.get_logger().info(f"simulating {', '.join(self._rig.joint_names)} on {names}")

    def destroy_node(self) -> None:
        """End the simulation, then the node."""
        loop = getattr(self, "_loop", None)
        if loop is not None:
            loop.stop()
        super().destroy_node()

    def share_priority(self) -> None:
        """Give a real-time priority to the other threads too, if the simulation's has one."""
        self._loop.share_priority()

    def check(self) -> None:
        """Raise the exception that ended the simulation's thread, if there was one."""
        self._loop.check()

    def _on_fault(self, message: Any) -> None:
        try:
            self._loop.inject(message.data)
        except PamError as error:
            self.get_logger().warning(f"inject_fault refused: {error}", throttle_duration_sec=1.0)
        else:
            self.get_logger().info(f"fault injected: {shown(message.data)}")

    def _on_mend(self, request: Any, response: Any) -> Any:
        self._loop.mend()
        response.success, response.message = True, "all faults have ended"
        return response

    def _publish(self) -> None:
        truth, at = self._loop.truth, self._loop.truth_time
        stamp = nanoseconds_of(at)
        joints, muscles = self._rig.joint_names, self._rig.muscle_names
        self._joints.publish(stamp, joints, truth.positions, truth.velocities, truth.torques)
        self._muscles.publish(stamp, muscles, truth.lengths, truth.speeds, truth.forces)
        self._pressures.publish(stamp, muscles, effort=truth.pressures)
        if self._supply_heard():
            supply = FluidPressure(fluid_pressure=truth.supply_pressure)
            supply.header.stamp = Time(nanoseconds=stamp).to_msg()
            self._supply.publish(supply)

    def _report(self) -> None:
        report = self._loop.report()
        fresh = report["skipped turns"] - self._skipped
        self._skipped = report["skipped turns"]
        level, text = OK, "in real time"
        if fresh > 0:
            level, text = WARN, f"the host is too slow: {fresh:.0f} turns skipped"
        status = diagnostic_status(f"{self.get_name()}: simulation", level, text, report)
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostic_array(stamp, status, namespace=self.get_namespace()))


def _make_node() -> RigNode:
    node = RigNode()
    node.share_priority()
    return node


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until a signal ends it."""
    return spin_node(_make_node, HELP, arguments, RigNode.check, mistake=PamError)


if __name__ == "__main__":
    sys.exit(main())
