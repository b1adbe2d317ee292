"""ROS 2 node of the controller: references and measurements in, valve commands out.

docs/controller.md describes topics, parameters and behaviour. The control cycle runs in one thread
with absolute deadlines, which takes the measurements itself. All other messages and the parameters
are handled by the executor in the main thread. What takes longer than a cycle there would keep
`~/stop` waiting: a design, the plan of a trajectory and files have threads of their own
(`pam_ros.slow_work`). The search of a design runs in a process of its own, because it would hold
the interpreter's lock.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import contextlib
import gc
import math
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from pam_control.actions.follow_trajectory import FollowTrajectory
from pam_control.command_intake import CommandIntake
from pam_control.control_step import Measurement
from pam_control.controller_health import ControllerHealth
from pam_control.controller_help import HELP
from pam_control.controller_inputs import NodeSide
from pam_control.controller_parameters import (
    COMMAND_DELAY,
    create_controller,
    parameter_table,
)
from pam_control.controller_topics import ControllerTopics
from pam_control.driver_follower import DriverFollower
from pam_control.driver_link import MakeLink, TopicLink
from pam_control.feedback.kept_designs import KeptDesigns, user_cache_folder
from pam_control.feedback.separate_process import SeparateProcess
from pam_control.operator_services import OperatorServices
from pam_control.reference_topics import ReferenceTopics
from pam_control.references.sine_burst import sine_burst
from pam_control.references.stiffness_excitation import StiffnessExcitation
from pam_control.setting_changes import SettingChanges
from pam_model.errors import PamError
from pam_model.rig import described_key, rig_of_node
from pam_ros import diagnostics as health
from pam_ros.errors import ParameterError
from pam_ros.parameter_row import Value
from pam_ros.parameters import NodeParameters
from pam_ros.periodic import MakeLoop, PeriodicLoop
from pam_ros.phase_follower import PhaseFollower
from pam_ros.slow_work import SlowWork
from pam_ros.spin import spin_node
from pam_ros.steady_timers import SteadyTimers

TEST_EVERY = 0.25  # s
SWITCH_INTERVAL = 5e-4  # s; the control thread can run soon after a callback has begun
NAME = "pam_controller"


class ControllerNode(Node):  # type: ignore[misc]
    """ROS interface of a `Controller`.

    Parameters
    ----------
    make_link : callable, optional
        Makes the link to the driver; by default over topics.
    make_loop : callable, optional
        Makes the loop that runs the cycles; by default a thread of this node.
    arguments : sequence of str, optional
        Arguments for this node alone, from `--ros-args` on.
    command_delay : float, optional
        From the controller to the valve by this link [s]: the default of `loop.command_delay`.

    Raises
    ------
    PamError, ParameterError
        For a rig or parameters that cannot be used, or a loop that would not be safe.
    """

    def __init__(
        self,
        make_link: MakeLink = TopicLink,
        make_loop: MakeLoop = PeriodicLoop,
        arguments: Sequence[str] = (),
        command_delay: float = COMMAND_DELAY,
    ) -> None:
        super().__init__(
            NAME,
            cli_args=list(arguments) or None,
            automatically_declare_parameters_from_overrides=True,
        )
        self._controller: Any = None
        names = self._joint_names_given()
        self._table = parameter_table(names, command_delay)
        self._declared = NodeParameters(
            self,
            self._table,
            rig_of_node,
            self._on_change,
            describe=described_key,
            usual_name=NAME,
            keeps_real_time=True,
        )
        self.rig = self._declared.described
        values = {p.name: self._declared[p.name] for p in self._table}
        folder = user_cache_folder()
        self._designs = KeptDesigns(folder)
        self.get_logger().info(
            f"designing the gains of {', '.join(self.rig.joint_names)}; designs of earlier starts "
            f"are {f'in {folder}' if folder else 'not kept: there is no home folder'}"
        )
        # the libraries of the design stay out of this process, at the first start as later
        self._design_process = SeparateProcess()
        self._designs.compute_in(self._design_process)
        self._controller = self._first_controller(values)
        self.steady_timers = SteadyTimers()
        self._designing, self._planning, self._foreseeing, self._writing = (
            SlowWork(name, self.steady_timers) for name in ("design", "plan", "limits", "files")
        )
        self._lock = threading.Lock()
        self._changes = SettingChanges(
            self._controller,
            self._lock,
            values,
            self._designing.submit,
            in_force=self._on_in_force,
            refused=self._on_refused,
        )
        self._log_design()

        self._origin = time.monotonic()
        self.intake = CommandIntake(
            self._controller,
            self._lock,
            self._now,
            self._reason_against_references,
            self.get_logger().warning,
        )
        self._action = FollowTrajectory(
            self,
            self.steady_timers,
            self._controller,
            self.intake,
            self._lock,
            values=lambda: self._changes.values,
            clock=self._now,
            seconds=self._seconds,
            reason_against=self._reason_against_references,
            planning=self._planning,
        )
        self._driver = DriverFollower(
            self._controller, self.intake, self._lock, self._now, drop_goal=self._action.drop
        )
        self._health = ControllerHealth(
            self.get_name(), self._controller, self.intake, self._changes, self._driver
        )

        every = self.rate / min(self._declared.number("telemetry.rate"), self.rate)
        self._topics = ControllerTopics(self, self.rig, max(1, round(every)))
        self._health_out = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.reference_topics = ReferenceTopics(
            self,
            self._controller,
            self.intake,
            self._planning,
            self._foreseeing,
            most_points=lambda: int(self._changes.values["trajectory.max_points"]),
            seconds=self._seconds,
        )
        self.operator_services = OperatorServices(
            self,
            self._controller,
            self.intake,
            self._lock,
            self._writing,
            values=lambda: self._changes.values,
            clock=self._now,
            reason=lambda: self._driver.silence,
        )
        self.steady_timers.add(1.0, self._report)
        self._stiffness_excitation = StiffnessExcitation(self._controller.references)
        self.steady_timers.add(TEST_EVERY, self._test_stiffness)
        driver = self._driver
        self._link = make_link(
            NodeSide(self, self.rig, self._now, self.intake.rejecting, driver.take, driver.lose)
        )
        self.polled_topics = self._link.polled_topics
        self._measurement = Measurement((), (), -math.inf, -math.inf)
        # of this cycle: when commands were computed, since 1970 [ns], and what the joints followed
        self._sent: int | None = None  # when the commands of this cycle were computed [ns]
        self.loop = make_loop(self._cycle, 1.0 / self.rate, "control", self.priority)
        self._follower = PhaseFollower(self.loop) if self._declared["loop.align"] else None
        gc.collect()
        gc.freeze()
        self.loop.start()

    def _first_controller(self, values: Mapping[str, Value]) -> Any:
        try:
            return create_controller(self.rig, values, self.rig.joint_names, self._designs)
        except BaseException:
            self._design_process.close()
            raise

    @property
    def rate(self) -> float:
        """Cycles per second [Hz]."""
        return self._declared.number("loop.rate")

    @property
    def priority(self) -> int:
        """Requested real-time priority of the loop."""
        return int(self._declared.number("loop.realtime_priority"))

    def _joint_names_given(self) -> list[str]:
        if not self.has_parameter("joints"):
            return []
        given = self.get_parameter("joints").value
        if not isinstance(given, Sequence) or isinstance(given, str):
            return []
        return [name for name in given if isinstance(name, str)]

    def _log_design(self) -> None:
        settings, law = self._controller.settings, self._changes.values["law"]
        self.get_logger().info(str(self._designs.take_report()))
        self.get_logger().info(
            f"{law}: feedforward {'on' if settings.feedforward else 'off'}, "
            f"pressure loop {settings.pressure_gain:.1f} 1/s"
        )
        for channel in self._controller.channels:
            name, own = channel.models.name, channel.setup.settings
            gains = channel.setup.gains.at(own.default_stiffness)
            self.get_logger().info(
                f"{name}: proportional {gains.proportional:.4g}, integral "
                f"{gains.integral:.4g}, derivative {gains.derivative:.4g}; "
                f"worst {channel.setup.margins[0]}"
            )
            self.get_logger().info(
                f"{name}: stiffness {own.default_stiffness:.3g} N m/rad until one is "
                f"commanded, at most {channel.models.scale.stiffness:.3g} in the middle of the "
                f"range; learns up to {own.adaptation_limit:.3g} N m"
            )

    def _now(self) -> float:
        """Seconds since the start by the monotonic clock, which cannot be set."""
        return time.monotonic() - self._origin

    def _seconds(self, stamp: Any) -> float | None:
        """A message's stamp on the controller's time axis; None for a stamp of 0.

        The wall clock is only used for the age of the stamp when the message arrives.
        """
        if stamp.sec == 0 and stamp.nanosec == 0:
            return None
        stamped = float(stamp.sec + 1e-9 * stamp.nanosec)
        return self._now() - (time.time() - stamped)

    def _vent_driver(self, reason: str) -> None:
        """Ask the driver to vent, after commands have stopped for good.

        The boards then vent within one cycle, without waiting for the time-out of the commands,
        and the driver is vented instead of faulty. If the driver does not answer, the time-out does
        it.
        """
        self.get_logger().error(f"stopped: {reason}; asking the driver to vent")
        self._link.vent()

    def _reason_against_references(self) -> str:
        return self._driver.reason_against_references()

    def set_parameters_atomically(self, parameter_list: Any) -> Any:
        """As the services for parameters call it; the answer says what is being designed."""
        return self._declared.with_remark(super().set_parameters_atomically(parameter_list))

    def _on_change(self, changes: Mapping[str, Value]) -> str:
        try:
            return self._changes.ask(changes)
        except PamError as error:
            raise ParameterError(str(error)) from None

    def _on_in_force(self, text: str) -> None:
        self.get_logger().info(text)
        self._log_design()

    def _on_refused(self, former: Mapping[str, Value], text: str) -> None:
        self.get_logger().error(text)
        self._declared.restore(former)

    # --- the control cycle ----------------------------------------------------------------------

    def _cycle(self, _: float) -> None:
        with _unless_ending():
            self.control()
            self.publish()

    def control(self) -> None:
        """The part of a cycle that the valves wait for: measurements to commands."""
        self._sent = None
        self._measurement = measurement = self._link.receive()
        if self._follower is not None:
            self._follower.follow(time.time() - self._link.arrival)
        now = self._now()
        with self._lock:
            if self._driver.reason:
                return
            guard = self._controller.guard
            before, swings = (guard.stopped, guard.softened), guard.swings
            guard.stopped = guard.stopped or self._link.two_publishers()
            try:
                output = self._controller.step(now, measurement)
                commands, reason = output.commands, output.reason
            except PamError as error:
                self._controller.deactivate()
                commands, reason = None, str(error)
            if commands is not None:
                self._action.observe(now)
            after = (guard.stopped, guard.softened)
        self._driver.silence = reason
        if after != before:
            self._tell_guard(*after)
        if guard.swings != swings:
            self.get_logger().warning(guard.swings)
        if commands is None:
            return
        self._sent = time.time_ns()
        self._link.send(self._sent, commands)
        self._health.count((now - measurement.position_time, now - measurement.pressure_time))

    def publish(self) -> None:
        """The rest of a cycle: what observers hear of it."""
        if self._sent is not None:
            self._topics.publish(self._sent, self._controller)

    def _tell_guard(self, stopped: str, softened: str) -> None:
        if stopped:
            self._vent_driver(stopped)
        elif softened:
            self.get_logger().error(f"soft gains from now on, until the next vent: {softened}")

    def _test_stiffness(self) -> None:
        """Move a joint that rests a little, if that was asked for."""
        values = self._changes.values
        amplitude = float(values["stiffness_test.amplitude"])
        if amplitude == 0.0:
            self._stiffness_excitation.forget()
            return
        with self._lock:
            named = self._controller.settings.learning_motion  # another motion is learnt
            if named or self._action.active or self._reason_against_references():
                return
            stiffnesses = self._controller.stiffness_commands
            due = self._stiffness_excitation.due(self._now(), stiffnesses, amplitude)
        if due is not None:
            name, position = due
            frequency = float(values["stiffness_test.frequency"])
            with self.intake.rejecting("stiffness_test"):
                points = sine_burst(position, amplitude, frequency)
                self.intake.follow([name], points, None)

    # --- health ---------------------------------------------------------------------------------

    def _report(self) -> None:
        now = self._now()
        ages = (now - self._measurement.position_time, now - self._measurement.pressure_time)
        law = str(self._changes.values["law"])
        statuses = self._health.statuses(now, self._driver.silence, law, self.loop, ages)
        with _unless_ending():
            stamp = self.get_clock().now().to_msg()
            self._health_out.publish(
                health.diagnostic_array(stamp, *statuses, namespace=self.get_namespace())
            )

    def destroy_node(self) -> None:
        """Stop the loop and then the node; nothing is sent afterwards."""
        try:
            self.loop.stop(timeout=5.0)
        finally:
            self._design_process.close()
            super().destroy_node()


@contextlib.contextmanager
def _unless_ending() -> Iterator[None]:
    """Ignore errors after a signal has ended the ROS context while threads are running."""
    try:
        yield
    except Exception:
        if rclpy.ok():
            raise


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until a signal stops it."""
    sys.setswitchinterval(SWITCH_INTERVAL)

    def make_node() -> ControllerNode:
        node = ControllerNode()
        node.loop.share_priority()
        return node

    return spin_node(
        make_node,
        HELP,
        arguments,
        lambda node: node.loop.check(),
        mistake=PamError,
        only_at_start=True,
    )


if __name__ == "__main__":
    sys.exit(main())
