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
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from pam_control.actions.follow_trajectory import FollowTrajectory
from pam_control.adapted_rig import AdaptedRig, adapted_rig, learnt_of, save_adapted_rig
from pam_control.command_intake import CommandIntake
from pam_control.control_step import JointTelemetry, Measurement
from pam_control.controller_health import ControllerHealth
from pam_control.controller_parameters import (
    COMMAND_DELAY,
    HELP,
    create_controller,
    kept_file,
    parameter_table,
)
from pam_control.controller_topics import ControllerTopics
from pam_control.driver_link import MakeLink, TopicLink
from pam_control.feedback.kept_designs import KeptDesigns, user_cache_folder
from pam_control.feedback.separate_process import SeparateProcess
from pam_control.references.stiffness_test import StiffnessTest
from pam_control.references.test_motion import test_motion
from pam_control.references.trajectory import CommandError
from pam_control.setting_changes import SettingChanges
from pam_control.trajectory_message import TrajectoryMessage, is_stop
from pam_model.errors import PamError
from pam_model.rig import described_key, rig_of_node
from pam_ros import diagnostics as health
from pam_ros.driver_state import (
    activation_of,
    permits_full_speed,
    reason_against_commands,
)
from pam_ros.errors import MalformedMessageError, ParameterError
from pam_ros.parameters import NodeParameters, Value
from pam_ros.periodic import MakeLoop, PeriodicLoop
from pam_ros.phase_follower import PhaseFollower
from pam_ros.slow_work import SlowWork
from pam_ros.spin import spin_node
from pam_ros.steady_timers import SteadyTimers
from pam_ros.subscriptions import GuardedTopic, subscribe

TEST_EVERY = 0.25  # s
LARGEST_TRAJECTORY = 2**26  # bytes; the number of points is limited by a parameter
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
        self._controller = create_controller(self.rig, values, self.rig.joint_names, self._designs)
        self._design_process = SeparateProcess()
        self._designs.compute_in(self._design_process)
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
        self._reason = "no measurement yet"
        self._activation = ""  # the last one that was received from the driver
        self._driver_reason = ""  # why the driver takes no commands; empty without such a driver
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
        self._health = ControllerHealth(
            self.get_name(), self._controller, self.intake, self._changes
        )

        every = self.rate / min(self._declared.number("telemetry.rate"), self.rate)
        self._topics = ControllerTopics(self, self.rig, max(1, round(every)))
        latest = QoSProfile(depth=1)
        self._health_out = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        # bytes, which its own reader reads: see pam_control.trajectory_message
        subscription = subscribe(
            self, JointTrajectory, "~/joint_trajectory", self._on_trajectory, 10,
            read=bytes, most_bytes=LARGEST_TRAJECTORY,
        )  # fmt: skip
        # taken here, since the main loop puts its own guard around the callbacks
        self._trajectories: GuardedTopic = subscription.callback
        subscribe(self, JointState, "~/commands", self._on_stream, latest)
        subscribe(self, Float64MultiArray, "~/stiffness_commands", self._on_stiffness, latest)
        subscribe(self, Float64MultiArray, "~/torque_commands", self._on_torque, latest)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/lower", self._on_lower)
        self.create_service(Trigger, "~/save_adapted_rig", self._on_save)
        self.steady_timers.add(1.0, self._report)
        self._stiffness_test = StiffnessTest(self._controller.references)
        self.steady_timers.add(TEST_EVERY, self._test_stiffness)
        self._link = make_link(
            self,
            self.rig,
            self._now,
            self.intake.rejecting,
            self._on_driver_state,
            self._on_lost_driver_state,
        )
        self.polled_topics = self._link.polled_topics
        self._measurement = Measurement((), (), -math.inf, -math.inf)
        # of this cycle: when commands were computed, since 1970 [ns], and what the joints followed
        self._sent: tuple[int, Sequence[JointTelemetry]] | None = None
        self.loop = make_loop(self._cycle, 1.0 / self.rate, "control", self.priority)
        self._follower = PhaseFollower(self.loop) if self._declared["loop.align"] else None
        gc.collect()
        gc.freeze()
        self.loop.start()

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
            gains, name, own = channel.setup.gains, channel.models.name, channel.setup.settings
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

    # --- messages in ----------------------------------------------------------------------------

    def _on_trajectory(self, data: bytes) -> None:
        """A stop at once; the plan of a motion takes seconds if it has many points."""
        most = int(self._changes.values["trajectory.max_points"])
        if is_stop(data):
            self.intake.trajectory(data, most, self._start_of)
            return
        with self.intake.rejecting("joint_trajectory"):
            if self._planning.full:
                raise CommandError("trajectory rejected: too many others are being planned")
            ticket = self.intake.ticket
            self._planning.submit(
                lambda: self._followed(data, most, ticket), self._on_trajectory_read
            )

    def _followed(self, data: bytes, most: int, ticket: int) -> str:
        """Follow a trajectory; return why it cannot be read, if so."""
        try:
            self.intake.trajectory(data, most, self._start_of, ticket)
        except MalformedMessageError as error:
            return str(error)
        return ""

    def _on_trajectory_read(self, malformed: str) -> None:
        if malformed:
            self._trajectories.refuse(malformed)

    def _start_of(self, message: TrajectoryMessage) -> float | None:
        return self._seconds(Time(sec=message.seconds, nanosec=message.nanoseconds))

    def _on_stream(self, message: Any) -> None:
        self.intake.stream(list(message.name), list(message.position), list(message.velocity))

    def _on_stiffness(self, message: Any) -> None:
        """At once, unless limits of motion for this stiffness have to be computed."""
        values = list(message.data)
        if not self._foreseeing.busy and self._controller.foresees(values):
            self.intake.stiffness(values)
            return
        with self.intake.rejecting("stiffness_commands"):
            if self._foreseeing.full:
                raise CommandError("stiffness command rejected: too many others wait")
            self._foreseeing.submit(
                lambda: self._controller.foresee_stiffness(values),
                lambda _: self.intake.stiffness(values),
            )

    def _on_torque(self, message: Any) -> None:
        self.intake.torque(list(message.data))

    def _on_stop(self, _: Any, response: Any) -> Any:
        """Stop category 2: brake and hold."""
        return self._act(response, self._controller.stop, "braking; the joints are held")

    def _on_lower(self, _: Any, response: Any) -> Any:
        """Stop category 1: brake, let the air out slowly, vent by the driver."""
        took = f"lowering, takes about {self._controller.settings.lowering_time:g} s"
        return self._act(response, self._controller.lower, took)

    def _act(self, response: Any, act: Callable[[float], None], done: str) -> Any:
        with self._lock:
            response.success = bool(self._controller.active)
            response.message = done if response.success else f"nothing moves: {self._reason}"
            if response.success:
                act(self._now())
                self.intake.supersede()
        self.get_logger().warning(response.message)
        return response

    def _on_save(self, _: Any, response: Any) -> Any:
        """Write a copy of the rig file with what was learnt."""
        try:
            if self._controller.guard.softened:
                raise PamError("nothing is learnt with soft gains, which are used until the next "
                               f"vent: {self._controller.guard.softened}")  # fmt: skip
            if not self._controller.adapts:
                raise PamError("nothing is learnt: adaptation.enabled is false, or the law is "
                               "not model_based")  # fmt: skip
            path = kept_file(self._changes.values, "adaptation.rig_file")
            if path is None:
                raise PamError("set the parameter adaptation.rig_file to the file to be written")
            if self._writing.full:
                raise PamError("other files are being written")
            with self._lock:
                learnt = [learnt_of(channel) for channel in self._controller.channels]
            made = adapted_rig(self.rig, learnt)
            self._writing.submit(lambda: _written(made, path), self.get_logger().info)
            response.message, response.success = f"being written: {path}; the log says when", True
        except PamError as error:
            response.message, response.success = str(error), False
        self.get_logger().info(f"save_adapted_rig: {response.message}")
        return response

    def _vent_driver(self, reason: str) -> None:
        """Ask the driver to vent, after commands have stopped for good.

        The boards then vent within one cycle, without waiting for the time-out of the commands,
        and the driver is vented instead of faulty. If the driver does not answer, the time-out does
        it.
        """
        self.get_logger().error(f"stopped: {reason}; asking the driver to vent")
        self._link.vent()

    def _on_driver_state(self, message: Any) -> None:
        """Follow the driver: while it takes no commands, references are dropped and refused.

        When it takes commands again, or was activated again, the next cycle takes over the joints
        where they are.
        """
        with self._lock:
            if self.rig.people.full_speed_topic:
                self._controller.reduce_speed(not permits_full_speed(message), self._now())
            self._driver_reason = reason_against_commands(message)
            self._health.driver = self._driver_reason or "takes commands"
            before, self._activation = self._activation, activation_of(message)
            if self._driver_reason or self._activation != before:
                self._drop(self._driver_reason or "the driver was activated again")
                self._reason = self._driver_reason

    def _on_lost_driver_state(self) -> None:
        """A state in which the driver takes no commands may have been among those lost."""
        with self._lock:
            self._drop("more messages of the driver's state arrived at once than are kept")

    def _drop(self, reason: str) -> None:
        """Drop what the controller follows; the lock is held.

        This holds although the next message, taken in the same cycle, says that all is well.
        """
        self._controller.drop_commands()
        self.intake.supersede()
        self._action.drop(reason)

    def _reason_against_references(self) -> str:
        """Why no references are taken; empty if they are."""
        if not self._controller.active:
            return f"the controller is not active: {self._reason}"
        return str(self._controller.reason_against_references())

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
            if self._driver_reason:
                return
            guard = self._controller.guard
            before = (guard.stopped, guard.softened)
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
        self._reason = reason
        if after != before:
            self._tell_guard(*after)
        if commands is None:
            return
        self._sent = sent_at, _ = time.time_ns(), output.joints
        self._link.send(sent_at, commands)
        self._health.count((now - measurement.position_time, now - measurement.pressure_time))

    def publish(self) -> None:
        """The rest of a cycle: what observers hear of it."""
        if self._sent is not None:
            self._topics.publish(*self._sent)

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
            self._stiffness_test.forget()
            return
        with self._lock:
            named = self._controller.settings.learning_motion  # another motion is learnt
            if named or self._action.active or self._reason_against_references():
                return
            stiffnesses = self._controller.stiffness_commands
            due = self._stiffness_test.due(self._now(), stiffnesses, amplitude)
        if due is not None:
            name, position = due
            frequency = float(values["stiffness_test.frequency"])
            with self.intake.rejecting("stiffness_test"):
                points = test_motion(position, amplitude, frequency)
                self.intake.follow([name], points, None)

    # --- health ---------------------------------------------------------------------------------

    def _report(self) -> None:
        now = self._now()
        ages = (now - self._measurement.position_time, now - self._measurement.pressure_time)
        law = str(self._changes.values["law"])
        statuses = self._health.statuses(now, self._reason, law, self.loop, ages)
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


def _written(made: AdaptedRig, path: Path) -> str:
    try:
        return f"save_adapted_rig: {save_adapted_rig(made, path)}"
    except PamError as error:
        return f"save_adapted_rig: not written: {error}"


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

    return spin_node(make_node, HELP, arguments, lambda node: node.loop.check(), mistake=PamError)


if __name__ == "__main__":
    sys.exit(main())
