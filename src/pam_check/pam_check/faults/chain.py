"""The whole chain in one process on a virtual clock, so that trials are fast and repeatable.

Boards, plant, bus, the real `CanPort`, driver, model and controller are those of the suite; only
sockets, ROS and waiting are missing. One step is 1 ms: the boards run in each step, driver and
controller alternately every 2 ms, and the model every 10 ms. The wall clock can be stepped
independently of the monotonic clock.
"""

from __future__ import annotations

import errno
import math
from collections import Counter, deque
from collections.abc import Callable
from typing import Final

import can

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_driver.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.command_intake import CommandError, NamedCommand
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.snapshot import Snapshot
from pam_model.errors import PamError
from pam_model.joints.joint_estimator import Estimate, JointEstimator
from pam_model.rig import Rig
from pam_ros.valve_command import ValveCommandFormat
from pam_sim.faults.frame_faults import FrameFaults
from pam_sim.simulated_rig import GroundTruth, SimulatedRig

STEP: Final = 1e-3
MODEL_STEPS: Final = 10  # between two estimates
AMPLITUDE, FREQUENCY = 0.35, 0.6  # amplitude and frequency of the motion [rad], [Hz]
START_UP = 0.5
COMMANDABLE: Final = frozenset({SafetyState.READY, SafetyState.ACTIVE})
BUS_OFF, RESTARTED, CONTROLLER = 0x40, 0x100, 0x04  # linux/can/error.h


class VirtualCan(can.BusABC):
    """The driver's end of a CAN bus as python-can shows it, with a controller that can fail.

    Attributes
    ----------
    to_boards : deque
        Frames that the driver has sent.
    down, bus_off, full : bool
        The interface is down; the CAN controller is bus-off; the transmit queue is full.
    """

    def __init__(self) -> None:
        self.to_boards: deque[tuple[int, bytes]] = deque()
        self.down = self.bus_off = self.full = False
        self._waiting: deque[can.Message] = deque()

    def deliver(self, frame: tuple[int, bytes], wall: float) -> None:
        """Queue a frame for the driver."""
        if not (self.down or self.bus_off):
            self._waiting.append(can.Message(wall, frame[0], False, data=frame[1]))

    def error(self, kind: int, detail: int = 0, wall: float = 0.0) -> None:
        """Queue an error frame of the CAN controller."""
        data = bytes((0, detail, 0, 0, 0, 0, 0, 0))
        self._waiting.append(can.Message(wall, kind, is_error_frame=True, data=data))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next queued frame."""
        if self.down:
            raise can.CanOperationError("network is down", errno.ENETDOWN)
        return self._waiting.popleft() if self._waiting else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a frame on the bus."""
        if self.down:
            raise can.CanOperationError("network is down", errno.ENETDOWN)
        if (
            self.full or self.bus_off
        ):  # a CAN controller that is bus-off sends no frame of its queue
            raise can.CanOperationError("no buffer space available", errno.ENOBUFS)
        self.to_boards.append((msg.arbitration_id, bytes(msg.data)))

    def shutdown(self) -> None:
        """There is nothing to close."""


class FaultChain:
    """A rig that moves a joint back and forth, with access to all its parts.

    Parameters
    ----------
    rig : Rig
        The rig that is simulated, driven and controlled.
    controller : Controller
        A control law for this rig; it starts anew.
    seed : int
        Seed of noise and frame faults.
    effects : dict, optional
        Effects of the plant.

    Attributes
    ----------
    now, wall : float
        Monotonic and wall clock [s].
    driver_runs, controller_runs : bool
        Whether these processes run; False has the effect of SIGSTOP or SIGKILL.
    edit : callable or None
        Changes each command of the controller when it is sent and returns the commands to send.
        Their age is how far back they are stamped.
    on_way : list of (NamedCommand, float)
        Commands that the driver has not received yet, and their stamps on the wall clock [s].
    inject, before_control : list of callable
        Called with the time, in each step before everything else and before the controller.
    snapshot : Snapshot or None
        The next measurements for model and controller.
    command_format : ValveCommandFormat
        Format of the controller's commands in a message.
    estimate, estimate_age : Estimate, float
        Last estimate of the model, and the age of its newest measurement at that time [s].
    noticed : Counter
        Number of refused commands by kind, and of refused requests.
    """

    def __init__(
        self,
        rig: Rig,
        controller: Controller,
        seed: int = 0,
        effects: dict[str, float] | None = None,
        settings: DriverSettings | None = None,
    ) -> None:
        self.rig = rig
        self.now = 0.0
        self.wall = 1000.0
        self.sim = SimulatedRig(rig, seed=seed, effects=effects)
        self.frames = FrameFaults(seed)
        self.can = VirtualCan()
        self.port = CanPort({"interface": "simulated", "channel": "faults"}, self.can)
        self.settings = settings or DriverSettings()
        self.driver = self.make_driver()
        self.controller = controller
        controller.deactivate()
        self.driver_runs = self.controller_runs = True
        self.edit: Callable[[NamedCommand], list[NamedCommand]] | None = None
        self.on_way: list[tuple[NamedCommand, float]] = []
        self.inject: list[Callable[[float], None]] = []
        self.before_control: list[Callable[[float], None]] = []
        self._later: list[tuple[float, Callable[[], None]]] = []
        self.noticed: Counter[str] = Counter()
        self.reason = ""
        self.reference = 0.0
        self.snapshot: Snapshot | None = None
        self.model = JointEstimator(rig)
        self.command_format = ValveCommandFormat(rig.valve_kinds)
        self.estimate = Estimate(None)
        self.estimate_age = math.inf
        self._tick = 0

    def make_driver(self, port: CanPort | None = None) -> Driver:
        """Make another driver on the same bus."""
        plausibility = PressurePlausibility(self.rig, 1.0 / 500.0)
        return Driver(self.rig, port or self.port, self.settings, plausibility)

    @property
    def truth(self) -> GroundTruth:
        """The true state of the plant, without sensor errors."""
        return self.sim.ground_truth()

    @property
    def moves_air(self) -> bool:
        """Whether any board allows its valves to do more than vent."""
        return any(
            command != valve.vented
            for board in self.sim.boards.values()
            for command, valve in zip(board.valve_commands, board.valves, strict=True)
        )

    def start(self) -> None:
        """Start everything and bring the joint into motion.

        Raises
        ------
        PamError
            If the driver does not activate, or stops again.
        """
        while self.now < START_UP:
            self.step()
        self.driver.activate(self.now)
        while self.now < START_UP + 1.0:
            self.step()
        if self.driver.state is not SafetyState.ACTIVE or not self.moves_air:
            reasons = "; ".join(str(fault) for fault in self.driver.faults)
            raise PamError(f"the chain does not start: {self.driver.state.value} {reasons}")

    def step(self) -> None:
        """Advance by one millisecond."""
        self._tick += 1
        self.now += STEP
        self.wall += STEP
        for entry in [entry for entry in self._later if entry[0] <= self.now]:
            self._later.remove(entry)
            entry[1]()
        for inject in self.inject:
            inject(self.now)
        self._bus()
        self._deliver()
        if self.driver_runs and self._tick % 2 == 0:
            self.snapshot = self.driver.cycle(self.now, self.wall)
        if self.controller_runs and self._tick % 2 == 1:
            self._control()
        if self._tick % MODEL_STEPS == 0:
            self._estimate()

    def at(self, time: float, action: Callable[[], None]) -> None:
        """Call a function at a time [s]."""
        self._later.append((time, action))

    def _bus(self) -> None:
        sim, queue = self.sim, self.can.to_boards
        while queue:
            for frame in self.frames.pass_on(queue.popleft(), "down", self.now):
                sim.on_frame(*frame, self.now)
        for frame in self.frames.due("down", self.now):
            sim.on_frame(*frame, self.now)
        for sent in sim.advance(self.now):
            for frame in self.frames.pass_on(sent, "up", self.now):
                self.can.deliver(frame, self.wall)
        for frame in self.frames.due("up", self.now):
            self.can.deliver(frame, self.wall)

    def _estimate(self) -> None:
        """Estimate as the model node does from the driver's topics."""
        seen = self.snapshot
        if seen is not None and self.driver_runs:
            rig, model = self.rig, self.model
            # as in the node, a message without a stamp gets the present time
            model.take_pressures(seen.pressure_stamp or self.wall, rig.muscle_names, seen.pressures)
            model.take_positions(
                seen.joint_stamp or self.wall, rig.joint_names, seen.positions, seen.velocities
            )
        self.estimate = self.model.estimate(self.wall)
        stamp = self.estimate.stamp
        self.estimate_age = math.inf if stamp is None else abs(self.wall - stamp)

    def _control(self) -> None:
        for action in self.before_control:
            action(self.now)
        seen = self.snapshot
        if seen is None:
            return
        if self.driver.state not in COMMANDABLE:  # the node follows the driver's state
            self.controller.deactivate()
            return
        references = self.controller.references
        if self.controller.active:
            angle = 2.0 * math.pi * FREQUENCY * (self.now - START_UP)
            turn = 2.0 * math.pi * FREQUENCY
            count = len(self.rig.joints)
            references.stream(
                self.rig.joint_names,
                [AMPLITUDE * math.sin(angle)] * count,
                [AMPLITUDE * turn * math.cos(angle)] * count,
                now=self.wall,
            )
        output = self.controller.step(
            self.wall,
            Measurement(
                seen.positions,
                seen.pressures,
                min(seen.joint_stamp, self.wall),
                min(seen.pressure_stamp, self.wall),
            ),
        )
        self.reason = output.reason
        if output.commands is None:
            return
        self.reference = references.sample(self.rig.joint_names[0], self.wall).position
        position, effort = self.command_format.pack(output.commands)
        command = NamedCommand(self.rig.muscle_names, position, (), effort, 0.0)
        for one in [command] if self.edit is None else self.edit(command):
            self.on_way.append((one, self.wall - one.age))

    def _deliver(self) -> None:
        """Give the driver the commands that were sent on valve_commands in an earlier step.

        As in the driver's node, the age of a command is the wall clock minus its stamp. A driver
        that was stopped gets the newest message when it continues, since the topic keeps only one.
        """
        if not self.driver_runs:
            del self.on_way[:-1]
            return
        messages, self.on_way = self.on_way, []
        for command, stamp in messages:
            try:
                self.driver.set_commands(command._replace(age=self.wall - stamp), self.now)
            except CommandError as error:
                self.noticed[error.kind] += 1
