"""A port to a robot on ROS topics: valve commands go out, pressures and angles come in.

The node runs in a process of its own, so that its loop goes on while numbers are identified.

The driver must be active, and no controller may run. A loop sends the latest commands in every
period; where nobody asks for more, because numbers are identified meanwhile, it sends the commands
that vent. The muscles of other joints are vented all the time.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Final

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from pam_demo.commission.robot_port import JointReading
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.driver_state import LATCHED, reason_against_commands
from pam_ros.node_end import end_node
from pam_ros.periodic import PeriodicLoop, real_time, take_priority
from pam_ros.start import start_ros
from pam_ros.steady_timers import turns
from pam_ros.subscriptions import subscribe
from pam_ros.unforeseen import hand_over, raise_handed_over
from pam_ros.valve_command import ValveCommandFormat

MEASUREMENT_DELAY, COMMAND_DELAY = 0.001, 0.003  # s, the defaults of the controller's node
MAX_AGE: Final = 0.1  # s, of a measurement
PRIORITY: Final = 20  # real-time, where the system permits it; as of the driver's loop
PLAYING: Final = 10  # of the thread that computes the next commands, below that of the driver
IDLE: Final = 10.0  # periods without new commands, after which the muscles are vented
FIRST: Final = 10.0  # s, for the first measurements
START: Final = 60.0  # s, in which the process of the node must have measurements
ANSWER: Final = 2.0  # s, in which it must answer
END: Final = 10.0  # s, in which it must have vented and ended
GONE: Final = "the process that sends the commands has ended"
SILENT: Final = "the process that sends the commands does not answer"
_SENSED = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def age_of_stamp(stamp: Any) -> float:
    """Age of a message that has just arrived, by its stamp [s]; 0 without one.

    A clock that is ahead makes no measurement younger than its arrival.
    """
    if stamp.sec == 0 and stamp.nanosec == 0:
        return 0.0
    age: float = time.time() - (stamp.sec + 1e-9 * stamp.nanosec)
    return max(age, 0.0)


class RosPortNode(Node):  # type: ignore[misc]
    """Publishes commands and keeps the latest measurements of one joint.

    Parameters
    ----------
    rig : Rig
        The whole robot.
    joint : str
        Name of the joint.
    period : float
        Of the commands [s].
    namespace : str
        Of the robot's nodes.
    """

    def __init__(self, rig: Rig, joint: str, period: float, namespace: str = "") -> None:
        super().__init__("pam_commission", namespace=namespace)
        self.period = period
        self.measurement_delay = MEASUREMENT_DELAY
        self.command_delay = COMMAND_DELAY + period
        self._joint, self._muscles = joint, rig.joint(joint).muscles
        self._names = list(rig.muscle_names)
        self._format = ValveCommandFormat(rig.valve_kinds)
        self._vented = list(self._format.vented)
        self._commands = list(self._vented)
        self._position, self._position_at = math.nan, -math.inf
        self._pressures: dict[str, float] = {}
        self._pressures_at = -math.inf
        self._refusal = ""
        self._turn = threading.Condition()
        self._turns = self._asked = 0
        self._vent = self.create_client(Trigger, "pam_driver/vent")
        self._publisher = self.create_publisher(JointState, "valve_commands", QoSProfile(depth=1))
        subscribe(self, JointState, "joint_states", self._take_positions, _SENSED)
        subscribe(self, JointState, "pressure_states", self._take_pressures, _SENSED)
        subscribe(self, DiagnosticStatus, "pam_driver/state", self._take_state, LATCHED)
        self.loop = PeriodicLoop(self._send, period, "commission")

    def _take_positions(self, message: Any) -> None:
        positions = dict(zip(message.name, message.position, strict=False))
        if self._joint in positions:
            self._position = float(positions[self._joint])
            self._position_at = time.monotonic() - age_of_stamp(message.header.stamp)

    def _take_pressures(self, message: Any) -> None:
        self._pressures = dict(zip(message.name, message.effort, strict=False))
        self._pressures_at = time.monotonic() - age_of_stamp(message.header.stamp)

    def _take_state(self, message: Any) -> None:
        self._refusal = reason_against_commands(message)

    def _send(self, _: float) -> None:
        with self._turn:
            self._turns += 1
            idle = self._turns - self._asked > IDLE
            commands = self._vented if idle else self._commands
            self._turn.notify_all()
        message = JointState(name=self._names)
        message.position, message.effort = self._format.pack(commands)
        message.header.stamp = self.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _reading(self) -> JointReading:
        now = time.monotonic()
        age, pressure_age = now - self._position_at, now - self._pressures_at
        fresh = max(age, pressure_age) < MAX_AGE
        pressures = [self._pressures.get(name, math.nan) for name in self._muscles]
        if not fresh:
            return JointReading(now, math.nan, (math.nan, math.nan), self._refusal)
        shown = float(pressures[0]), float(pressures[1])
        return JointReading(now, self._position, shown, self._refusal, age, pressure_age)

    def advance(self, commands: Sequence[float]) -> JointReading:
        """As of every `RobotPort`: sends the commands in the next turn of the loop.

        Raises
        ------
        PamError
            When the loop has ended, or a callback failed.
        """
        whole = list(self._vented)
        for muscle, value in zip(self._muscles, commands, strict=True):
            whole[self._names.index(muscle)] = float(value)
        with self._turn:
            self._commands = whole
            before = self._asked = self._turns
            if not self._turn.wait_for(lambda: self._turns > before, timeout=1.0):
                self.loop.check()
                raise PamError("the loop of the commissioning stands still")
        raise_handed_over()
        return self._reading()

    def wait_for_measurements(self) -> None:
        """Wait until pressures and angle arrive.

        Raises
        ------
        PamError
            If they do not.
        """
        deadline = time.monotonic() + FIRST
        while True:
            reading = self.advance([self._vented[self._names.index(m)] for m in self._muscles])
            if reading.known:
                return
            if time.monotonic() > deadline:
                raise PamError(
                    f"no measurements of {self._joint} on joint_states and pressure_states within "
                    f"{FIRST:g} s; is the driver active?"
                )

    def vent(self) -> None:
        """Ask the driver to vent, which is necessary before its commands may stop."""
        if self._vent.service_is_ready():
            answered = threading.Event()
            asked = self._vent.call_async(Trigger.Request())
            asked.add_done_callback(lambda _: answered.set())
            answered.wait(ANSWER)


@contextmanager
def _spinning(node: RosPortNode) -> Iterator[None]:
    """Deliver messages and send commands as long as the context lasts; at its end, vent."""
    executor = EventsExecutor()
    executor.add_node(node)
    going_on = True

    def spin() -> None:
        try:
            for _ in turns(executor, None, lambda: going_on):
                pass
        except Exception as error:  # the thread that plays raises it
            hand_over(error)

    spinning = threading.Thread(target=spin, name="spin", daemon=True)
    spinning.start()
    node.loop.start()
    try:
        yield
    finally:
        time.sleep(2.0 * IDLE * node.period)  # the loop sends what vents
        node.vent()
        node.loop.stop()
        going_on = False
        spinning.join(2.0)
        end_node(node, executor)
        rclpy.try_shutdown()


def _serve(answers: Connection, rig: Rig, joint: str, period: float, namespace: str) -> None:
    """Run a node for another process, which sends commands and gets readings, until it ends.

    Ctrl-C reaches this process, too; the other one decides what follows, and the air needs it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    take_priority(PRIORITY)  # before there are other threads, which inherit it
    try:
        start_ros([])
        node = RosPortNode(rig, joint, period, namespace)
        with _spinning(node):
            node.wait_for_measurements()
            answers.send((node.measurement_delay, node.command_delay))
            with contextlib.suppress(EOFError):
                while True:
                    answers.send(node.advance(answers.recv()))
    except PamError as error:
        with contextlib.suppress(OSError):
            answers.send(str(error))
    except OSError:  # the other process has ended
        return


class RosPort:
    """A port whose node runs in a process of its own.

    Numbers are identified and motions planned for many seconds between two motions. In one process
    with the node they would keep the commands from being sent, and the driver would vent.

    Parameters
    ----------
    period : float
        Of the commands [s].
    """

    def __init__(self, answers: Connection, period: float) -> None:
        self.period = period
        self._answers = answers
        self.measurement_delay, self.command_delay = self._received(START)

    def _received(self, longest: float) -> Any:
        try:
            found = self._answers.recv() if self._answers.poll(longest) else SILENT
        except (EOFError, OSError):
            found = GONE
        if isinstance(found, str):
            raise PamError(found)
        return found

    def advance(self, commands: Sequence[float]) -> JointReading:
        """As of every `RobotPort`: sends the commands in the next turn of the loop.

        Raises
        ------
        PamError
            When the node has ended, or one of its callbacks failed.
        """
        try:
            self._answers.send([float(value) for value in commands])
        except OSError:
            raise PamError(GONE) from None
        reading: JointReading = self._received(ANSWER)
        return reading


@contextmanager
def open_ros_port(rig: Rig, joint: str, period: float, namespace: str = "") -> Iterator[RosPort]:
    """A port to the robot in the ROS domain of this terminal; at its end the muscles are vented.

    Parameters
    ----------
    rig : Rig
        The whole robot.
    joint : str
        Name of the joint.
    period : float
        Of the commands [s].
    namespace : str
        Of the robot's nodes.

    Raises
    ------
    PamError
        If no measurements arrive.
    """
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(
        target=_serve, args=(there, rig, joint, period, namespace), name="commission", daemon=True
    )
    process.start()
    there.close()
    try:
        port = RosPort(here, period)
        with real_time(PLAYING):
            yield port
    finally:
        here.close()
        process.join(END)
        if process.is_alive():
            process.kill()
