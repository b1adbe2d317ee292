"""The driver as a ROS 2 lifecycle node: it connects valve boards on a CAN bus with topics.

"configure" opens the bus and begins to measure, "activate" lets valves move, "deactivate" vents.
At start-up the node configures itself; it activates itself only where a parameter asks for it.
A fault vents, is latched, and returns the node to inactive. See docs/driver.md.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import gc
import logging
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.node import Node

from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_assembly import assemble_driver
from pam_driver.driver_diagnostics import DriverDiagnostics
from pam_driver.driver_end import end_driver
from pam_driver.driver_inputs import DriverInputs
from pam_driver.driver_log import DriverLog
from pam_driver.driver_parameters import HELP, TABLE, bus_options
from pam_driver.driver_services import DriverServices
from pam_driver.driver_state_topic import DriverStateTopic
from pam_driver.driver_topics import DriverTopics
from pam_driver.reported_state import ReportedState
from pam_driver.safety.stalled_cycle import StalledCycleWatch
from pam_driver.safety.states import FAULTY, MOVING
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_driver.snapshot import Snapshot
from pam_driver.start_up import Advice, StartUp
from pam_model.errors import PamError
from pam_model.rig import Rig, described_key, rig_of_node
from pam_ros.diagnostics import diagnostic_array
from pam_ros.end_signals import EndSignals
from pam_ros.errors import ParameterError
from pam_ros.lifecycle import notice_errors_of_transitions, refuse_impossible_transitions
from pam_ros.node_end import end_node
from pam_ros.node_help import MISTAKE, tell_mistake
from pam_ros.parameters import NodeParameters
from pam_ros.periodic import Loop, MakeLoop, PeriodicLoop
from pam_ros.phase_follower import PhaseFollower
from pam_ros.start import start_ros
from pam_ros.steady_timers import SteadyTimers, turns
from pam_ros.unforeseen import BROKEN, described, hand_over

_SUCCESS = TransitionCallbackReturn.SUCCESS
_FAILURE = TransitionCallbackReturn.FAILURE
_WATCH_PERIOD = 0.05
NAME = "pam_driver"


class Partner(Protocol):
    """A controller in the same process, which takes part in the driver's cycle."""

    source: str  # who computed its commands, as its messages on `valve_commands` say it

    def control(self, snapshot: Snapshot) -> object:
        """Compute commands for this cycle, and hand them to `DriverNode.take_commands`."""

    def hear_state(self, message: Any) -> object:
        """Take a message of `~/state`."""


class DriverNode(LifecycleNode):  # type: ignore[misc]
    """Connects `Driver` with ROS: parameters, messages, and one call of `Driver.cycle` per cycle.

    Parameters
    ----------
    make_loop : callable, optional
        Makes the loop that runs the cycles; by default a thread of this node.
    partner : Partner, optional
        A controller in the same process. Others are still heard on `valve_commands`.
    arguments : sequence of str, optional
        Arguments for this node alone, from `--ros-args` on.

    Raises
    ------
    PamError, ParameterError
        If the parameters or the rig cannot be used.
    """

    def __init__(
        self,
        make_loop: MakeLoop = PeriodicLoop,
        partner: Partner | None = None,
        arguments: Sequence[str] = (),
    ) -> None:
        super().__init__(
            NAME,
            cli_args=list(arguments) or None,
            automatically_declare_parameters_from_overrides=True,
        )
        self._make_loop, self._partner = make_loop, partner
        self.failure = ""
        self.runs = False  # from now on no exception is a mistake of the user
        self.hurry: Callable[[], bool] = lambda: False
        self._values = NodeParameters(
            self, TABLE, rig_of_node, describe=described_key, usual_name=NAME, keeps_real_time=True
        )
        self._rig = self._values.described
        bus_options(str(self._values["bus.options"]))
        if self._values["activate_on_start"] and not self._values["autostart"]:
            raise ParameterError("activate_on_start: true needs autostart: true")
        self._ports: dict[str, CanPort] = {}
        self._driver: Driver | None = None
        self._loop: Loop | None = None
        self._follower: PhaseFollower | None = None
        self._diagnostics: DriverDiagnostics | None = None
        self._snapshot: Snapshot | None = None
        self._active = False
        self._starting = False
        self._start_up = StartUp()
        self._log = DriverLog(self.get_logger(), self.get_fully_qualified_name())
        self._stalled_cycle = StalledCycleWatch(_WATCH_PERIOD)
        refuse_impossible_transitions(self)
        notice_errors_of_transitions(self, self._notice)

        keeps_nan = bool(self._values["joint_states.keep_nan"])
        every = self.rate / (self._values.number("publish_rate") or self.rate)
        self._topics = DriverTopics(self, self._rig, keeps_nan, max(1, round(every)))
        self._diagnostics_topic = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._inputs = DriverInputs(
            self,
            self._rig.people,
            lambda: self._driver,
            lambda: None if partner is None else partner.source,
        )
        self.polled_topics = self._inputs.topics
        self._reported = ReportedState(
            DriverStateTopic(
                self.get_name(),
                partial(Node.create_publisher, self),
                None if partner is None else partner.hear_state,
            ),
            self._start_up,
            has_full_speed_input=bool(self._rig.people.full_speed_topic),
        )
        self._calls = DriverServices(
            self, lambda: self._driver, self._start_up, self._reported, self._log
        )
        self.vent = self._calls.vent
        self._reported.publish(None)
        self.steady_timers = SteadyTimers()
        self.steady_timers.add(_WATCH_PERIOD, self._watch)
        self.steady_timers.add(1.0, self._publish_diagnostics)
        rate = self._values.number("fluid_pressure_rate")
        self.steady_timers.add(1.0 / rate, self._publish_fluid_pressures)

    def autostart(self) -> bool:
        """Configure now, and activate when every board answers if `activate_on_start` asks for it.

        Returns False if configuring failed.
        """
        if not self._values["autostart"]:
            return True
        self._starting = True
        configured = self.trigger_configure() == _SUCCESS
        self._starting = False
        if not configured:
            return False
        until = time.monotonic() + self._values.number("startup_timeout")
        self._start_up.begin(until, bool(self._values["activate_on_start"]))
        return True

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Open the bus and begin to measure; every valve vents."""
        try:
            made = assemble_driver(self._rig, self._values)
        except PamError as error:
            return self._fail(str(error))
        self._driver, self._ports, self._diagnostics, doubts = made
        self._loop = self._make_loop(
            partial(self._cycle, made.driver),
            1.0 / self.rate,
            "bus I/O",
            self.priority,
        )
        self._follower = PhaseFollower(self._loop) if self._values["align"] else None
        self._loop.start()
        self._log.measuring(made.driver, (port.name for port in made.ports.values()), doubts)
        self._reported.vent_reason = "configured, not activated yet"
        self._reported.publish(self._driver)
        return _SUCCESS

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Let valves follow commands, beginning with the next one, if nothing is wrong."""
        if self._driver is None:
            return _FAILURE
        try:
            self._start_up.activate(self._driver, time.monotonic())
        except PamError as error:
            return self._fail(f"not activated: {error}")
        self._active = True
        self._reported.activated()
        self._reported.publish(self._driver)
        self.get_logger().info("active: valves follow valve_commands")
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Lower the joints and vent."""
        self._active = False
        if self._driver is not None:
            self._driver.deactivate(time.monotonic())
        told = "" if self._driver is None else self._driver.vent_reason
        self._reported.vent_reason = self._reported.vent_reason or told or "deactivated"
        self._reported.publish(self._driver)
        state_name = "unconfigured" if self._driver is None else self._driver.state.value
        self.get_logger().info(f"inactive: {state_name}")
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Vent and close the bus."""
        self._calls.cancel_start("a clean-up")
        self.close()
        return _SUCCESS

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """Vent and close the bus."""
        self.close()
        return _SUCCESS

    def on_error(self, state: Any) -> TransitionCallbackReturn:
        """Vent and close the bus; the node may be configured again."""
        self.close()
        return _SUCCESS

    @property
    def rig(self) -> Rig:
        """The robot."""
        return self._rig

    @property
    def rate(self) -> float:
        """Cycles per second [Hz]."""
        return self._values.number("rate")

    @property
    def priority(self) -> int:
        """Requested real-time priority of the loop."""
        return int(self._values.number("realtime_priority"))

    def share_priority(self) -> None:
        """Give a real-time priority to the other threads too, if the I/O thread has one."""
        if self._loop is not None:
            self._loop.share_priority()

    def check(self) -> None:
        """Raise the exception that ended the I/O thread, if there was one."""
        if self._loop is not None:
            self._loop.check()

    def fail(self, error: Exception) -> None:
        """Latch an unexpected exception as a fault, and say so; the process must end."""
        if self._reported.broken:
            return
        self._reported.broken = described(error)
        driver = self._driver
        if driver is not None and driver.broken is None:
            driver.fail(self._reported.broken, time.monotonic())
        self._log.broken(error, lowers=driver is not None and driver.lowers)
        self._tell_last_state()

    def _notice(self, error: Exception) -> None:
        """Act on the exception of a transition before rclpy calls `on_error`."""
        self.fail(error)
        hand_over(error)

    def _tell_last_state(self) -> None:
        """Publish the state; after an exception, what fails here must not stop the end."""
        try:
            self._reported.publish(self._driver)
        except Exception as error:
            self.get_logger().debug(described(error))

    def _fail(self, reason: str) -> TransitionCallbackReturn:
        self.failure = reason
        if not self._starting:  # during autostart `main` prints the reason and ends
            self.get_logger().error(reason)
        return _FAILURE

    def close(self) -> None:
        """Lower the arm, stop the thread, vent, close the bus; safe to call twice."""
        loop, self._loop = self._loop, None
        driver = self._driver  # the I/O thread still reads the operator inputs until it stops
        ports, self._ports = self._ports, {}
        self._diagnostics = self._snapshot = None
        self._active = False
        if driver is not None:
            self._start_up.leave(driver)
        try:
            end_driver(driver, loop, ports.values(), self.hurry, self.get_logger().error)
        finally:
            self._driver = None
            self._reported.vent_reason = ""
            if rclpy.ok():
                self._tell_last_state()

    def _cycle(self, driver: Driver, now: float) -> None:
        """One cycle, in the I/O thread; after an exception only what stops the joints."""
        try:
            if driver.broken is not None:
                self._inputs.poll_people()
                driver.cycle(now, time.time(), lambda: (time.monotonic(), time.time()))
                return
            self._inputs.poll()
            self._whole_cycle(driver, now)
        except Exception as error:
            self.break_down(error)

    def break_down(self, error: Exception) -> None:
        """Stop after an exception in the cycle; the main loop then ends the process."""
        if self._driver is not None:
            self._driver.fail(described(error), time.monotonic())
        hand_over(error)

    def _whole_cycle(self, driver: Driver, now: float) -> None:
        wall_now = time.time()
        control = None if self._partner is None else self._partner.control
        snapshot = driver.cycle(now, wall_now, lambda: (time.monotonic(), time.time()), control)
        sent_at = time.time()
        if self._follower is not None:
            self._follower.follow(wall_now - snapshot.newest_stamp)
        self._snapshot = snapshot
        self._topics.publish(snapshot, driver.intake, wall_now, sent_at)

    def take_commands(self, command: NamedCommand, arrived: float) -> None:
        """Use valve commands of the partner, computed at this moment [s], or refuse them."""
        self._inputs.take(command, arrived)

    def _watch(self) -> None:
        """Log what the I/O thread has found, and make the lifecycle transitions that follow."""
        driver = self._driver
        if driver is None:
            self._inputs.poll()
            return
        if driver.broken is not None:  # `fail` is called in this turn, and reports it
            return
        if self._loop is not None and (stalled := self._stalled_cycle.look(self._loop)):
            driver.stop_stalled(stalled, time.monotonic())
        self._reported.publish(self._driver)
        if driver.state in FAULTY:
            self._log.faults(driver)
        if self._active and driver.state not in MOVING:
            self.trigger_deactivate()
        if self._active:
            self._start_up.end()
        advice, reason = self._start_up.step(driver, time.monotonic())
        if advice is Advice.ACTIVATE:
            self.trigger_activate()
        self._log.start(advice, reason)

    def _publish_fluid_pressures(self) -> None:
        if self._snapshot is not None:
            self._topics.publish_fluid_pressures(self._snapshot)

    def _publish_diagnostics(self) -> None:
        if self._diagnostics is None or self._loop is None:
            return
        self._diagnostics.commanders = self.count_publishers("valve_commands")
        if self._snapshot is not None:
            self._diagnostics.unmeasured = self._topics.unmeasured(self._snapshot)
        statuses = self._diagnostics.statuses(self._loop.statistics, time.monotonic())
        self._diagnostics_topic.publish(
            diagnostic_array(
                self.get_clock().now().to_msg(), *statuses, namespace=self.get_namespace()
            )
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; returns the exit code."""
    ended = HELP.answer(arguments)
    if ended is not None:
        return ended
    logging.getLogger("can").setLevel(logging.ERROR)
    sys.setswitchinterval(0.0005)  # else the I/O thread may wait 5 ms for the executor's thread
    code = 0
    with EndSignals() as signals:
        node: DriverNode | None = None
        executor: EventsExecutor | None = None
        try:
            # rclpy's own handlers would close the context while the I/O thread still has to vent
            start_ros(arguments)
            node = DriverNode()
            node.hurry = lambda: signals.urgent
            if not node.autostart():
                tell_mistake(node.failure)
                return MISTAKE
            executor = EventsExecutor()
            executor.add_node(node)
            gc.collect()
            gc.freeze()
            node.share_priority()
            timers = node.steady_timers
            node.runs = True
            for _ in turns(executor, timers, lambda: not signals.asked and rclpy.ok()):
                node.check()
        except Exception as error:
            if node is None or not node.runs:
                if not isinstance(error, (PamError, ParameterError)):
                    raise
                tell_mistake(error)
                return MISTAKE
            code = BROKEN
            node.fail(error)
        finally:
            if node is not None:
                node.close()
            end_node(node, executor)
            rclpy.try_shutdown()
    return code


if __name__ == "__main__":
    sys.exit(main())
