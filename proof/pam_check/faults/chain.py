"""The whole chain in one process on a virtual clock, so that trials are fast and repeatable.

Boards, plant, bus, the real `CanPort`, driver, model and controller are those of the suite; only
sockets, ROS and waiting are missing. One step is 1 ms: the boards run in each step, driver and
controller alternately every 2 ms, and the model every 10 ms. The wall clock can be stepped
independently of the monotonic clock.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Final

import can

from pam_check.faults.virtual_can import VirtualCan
from pam_control.command_intake import CommandIntake
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand
from pam_driver.snapshot import Snapshot
from pam_driver.start_up import StartUp
from pam_model.errors import PamError
from pam_model.joints.joint_estimator import Estimate, JointEstimator
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_ros.message_sources import MessageSources
from pam_ros.valve_command import ValveCommandFormat
from pam_sim.faults.frame_faults import FrameFaults
from pam_sim.simulated_rig import GroundTruth, SimulatedRig

STEP: Final = 1e-3
MODEL_STEPS: Final = 10  # between two estimates
STATE_STEPS: Final = 50  # between two messages of the driver's state
AMPLITUDE, FREQUENCY = 0.35, 0.6  # amplitude and frequency of the motion [rad], [Hz]
TOP_SPEED = 2.0 * math.pi * FREQUENCY * AMPLITUDE  # of this motion [rad/s]
START_UP = 0.5
# Time of a message from process to process: least, mean beyond it, and most [s].
MESSAGE_TIME = (4e-4, 3e-4, 4e-3)
COMMANDABLE: Final = frozenset({SafetyState.READY, SafetyState.ACTIVE})


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
    intake : CommandIntake
        Takes references as the controller's node does.
    motion : callable or None
        Angle and speed [rad], [rad/s] that a user streams at a time [s]; None: nothing is streamed.
    command_time, measurement_time : callable
        Return how long the next message of this kind is on its way [s].
    on_way : list of (NamedCommand, float, float)
        Commands that the driver has not received yet, their stamps on the wall clock and when they
        arrive on the monotonic clock [s].
    inject, before_control, after : list of callable
        Called with the time, in each step before everything else, before the controller, and after
        everything else.
    published, snapshot : Snapshot or None
        The last measurements that the driver has sent, and that model and controller have received.
    heard : Measurement
        The same for the controller, with times on the monotonic clock.
    command_format : ValveCommandFormat
        Format of the controller's commands in a message.
    estimate, estimate_age : Estimate, float
        Last estimate of the model, and the age of its newest measurement at that time [s].
    claims : list of callable
        What a fault must not do beside its bounds: each returns what is wrong now, or nothing.
    one_process : bool
        Whether the controller takes part in the driver's cycle, so that nothing is on its way
        between them.
    start_up : StartUp
        The rules of the driver's process, which decide whether it may activate.
    unstamped : bool
        Whether the controller's commands carry no stamp.
    obeys_speed : bool
        Whether the controller keeps the reduced speed when full speed is not permitted.
    lowered_at : float
        When the driver last lowered the joints [s].
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
        *,
        one_process: bool = False,
    ) -> None:
        self.rig = rig
        self.one_process = one_process
        self.now = 0.0
        self.wall = 1000.0
        self.sim = SimulatedRig(rig, seed=seed, effects=effects)
        self.frames = FrameFaults(seed)
        self.can = VirtualCan()
        self.port = self.open_port("faults", self.can)
        self.settings = settings or DriverSettings()
        self.driver = self.make_driver()
        self.controller = controller
        self.intake = CommandIntake(
            controller, Lock(), lambda: self.now, self._reason_against, self._note_refusal
        )
        controller.deactivate()
        self.driver_runs = self.controller_runs = True
        self.edit: Callable[[NamedCommand], list[NamedCommand]] | None = None
        self.motion: Callable[[float], tuple[float, float]] | None = swing
        self._random = random.Random(seed)
        self.command_time: Callable[[], float] = self.message_time
        self.measurement_time: Callable[[], float] = self.message_time
        self.on_way: list[tuple[NamedCommand, float, float]] = []
        self._measured: list[tuple[Snapshot, float]] = []
        self.heard = Measurement((), (), -math.inf, -math.inf)
        self._sources = MessageSources()
        self.inject: list[Callable[[float], None]] = []
        self.before_control: list[Callable[[float], None]] = []
        self.after: list[Callable[[float], None]] = []
        self._later: list[tuple[float, Callable[[], None]]] = []
        self.claims: list[Callable[[], str]] = []
        self.noticed: Counter[str] = Counter()
        self.start_up = StartUp()
        self.unstamped = False
        self.obeys_speed = True
        self.lowered_at = -math.inf
        self.reason = ""
        self.reference = 0.0
        self.published: Snapshot | None = None
        self.snapshot: Snapshot | None = None
        self.model = JointEstimator(compose(rig))
        self.command_format = ValveCommandFormat(rig.valve_kinds)
        self.estimate = Estimate(None)
        self.estimate_age = math.inf
        self._tick = 0

    def make_driver(self, port: CanPort | None = None) -> Driver:
        """Make another driver on the same bus."""
        plausibility = PressurePlausibility(compose(self.rig), 1.0 / 500.0)
        return Driver(self.rig, port or self.port, self.settings, plausibility)

    def open_port(self, channel: str, bus: can.BusABC) -> CanPort:
        """Open an end of the bus that receives the frames of this rig's boards."""
        extended = self.sim.wiring.extended_identifiers("")
        return CanPort({"interface": "simulated", "channel": channel}, bus, extended)

    def _reason_against(self) -> str:
        if not self.controller.active:
            return f"the controller is not active: {self.reason}"
        return self.controller.reason_against_references()

    def _note_refusal(self, text: str) -> None:
        self.noticed["refused references"] += "rejected" in text
        self.noticed["slowed references"] += "rejected" not in text

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
            control = self._control_within if self.one_process else None
            self.published = self.driver.cycle(self.now, self.wall, control=control)
            if not self.one_process:
                self._measured.append((self.published, self.now + self.measurement_time()))
        if not self.one_process and self.controller_runs and self._tick % 2 == 1:
            self._control()
        if self._tick % MODEL_STEPS == 0:
            self._estimate()
        if self.driver.lowers:
            self.lowered_at = self.now
        for look in self.after:
            look(self.now)

    def message_time(self) -> float:
        """How long a message between two processes is on its way: mostly below 1 ms [s]."""
        least, mean, most = MESSAGE_TIME
        return min(least + self._random.expovariate(1.0 / mean), most)

    def power_cycle(self, effects: Mapping[str, float]) -> None:
        """Switch the rig off and on, with these hidden effects, and bring it into motion again.

        Raises
        ------
        PamError
            If the driver does not activate.
        """
        motion, self.motion = self.motion, None
        self.driver.vent(self.now)
        while self.driver.lowers:
            self.step()
        self.sim = SimulatedRig(self.rig, effects=effects, now=self.now)
        self.wait(START_UP)
        self.start_up.clear_faults(self.driver, self.now)
        self.wait(0.02)
        self.start_up.activate(self.driver, self.now)
        self.wait(0.3)
        self.motion = motion
        self.wait(1.0)

    def wait(self, duration: float) -> None:
        """Let a time pass [s]."""
        until = self.now + duration
        while self.now < until:
            self.step()

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

    def _control_within(self, measured: Snapshot) -> None:
        """The controller's part in the driver's cycle."""
        self.hear(measured)
        if self.controller_runs:
            self._control()

    def _control(self) -> None:
        for action in self.before_control:
            action(self.now)
        seen = self.snapshot
        if seen is None:
            return
        if self.driver.state not in COMMANDABLE:  # the node follows the driver's state
            self.controller.drop_commands()
            return
        if self._tick % STATE_STEPS == 1:
            reduced = self.driver.people.reduced_speed(self.now)
            self.controller.limits.reduce_speed(reduced and self.obeys_speed, self.now)
        references = self.controller.references
        if self.controller.active and self.motion is not None:
            angle, speed = self.motion(self.now)
            count = len(self.rig.joints)
            self.intake.stream(self.rig.joint_names, [angle] * count, [speed] * count)
        stopped = self.controller.guard.stopped
        self.controller.guard.stopped = stopped or self._sources.taking_turns(self.now)
        try:
            output = self.controller.step(self.now, self.heard)
            commands, self.reason = output.commands, output.reason
        except PamError as error:  # as the node does
            self.controller.deactivate()
            commands, self.reason = None, str(error)
        if self.controller.guard.stopped != stopped:  # as the node does
            later = 0.0 if self.one_process else self.command_time()
            self.at(self.now + later, lambda: self.driver.vent(self.now))
        if commands is None:
            return
        self.reference = references.sample(self.rig.joint_names[0], self.now).position
        position, effort = self.command_format.pack(commands)
        command = NamedCommand(self.rig.muscle_names, position, (), effort, 0.0)
        for one in [command] if self.edit is None else self.edit(command):
            if self.one_process:
                self._take(one, one.age)
                continue
            arrives = self.now + self.command_time()
            self.on_way.append((one, self.wall - one.age, arrives))

    def _take(self, command: NamedCommand, age: float) -> None:
        """Give a command to the driver, which may refuse it."""
        try:
            self.driver.set_commands(command._replace(age=age), self.now)
        except CommandRefusedError as error:
            self.noticed[error.kind] += 1

    def _deliver(self) -> None:
        """Deliver the messages that arrive in this step: valve commands, and measurements.

        As in the nodes, a stamp tells how old a message is when it arrives, by the wall clock; from
        then on its age grows by the monotonic clock. A process that was stopped gets the newest
        message of a topic when it continues, since the topics keep only one.
        """
        arrived = [entry for entry in self.on_way if entry[2] <= self.now]
        if self.driver_runs:
            self.on_way = [entry for entry in self.on_way if entry[2] > self.now]
            for command, stamp, _ in arrived:
                self._take(command, 0.0 if self.unstamped else self.wall - stamp)
        else:
            self.on_way = arrived[-1:] + [entry for entry in self.on_way if entry[2] > self.now]
        came = [snapshot for snapshot, arrives in self._measured if arrives <= self.now]
        self._measured = [entry for entry in self._measured if entry[1] > self.now]
        if came:
            self.hear(came[-1])

    def hear(self, seen: Snapshot, source: str = "driver") -> None:
        """Take measurements of a source as the controller's node does."""
        self._sources.hear(source, self.now)
        self.snapshot = seen
        times = [
            min(self.now - (self.wall - stamp), self.now) if stamp else self.now
            for stamp in (seen.joint_stamp, seen.pressure_stamp)
        ]
        self.heard = Measurement(seen.positions, seen.pressures, times[0], times[1])


def swing(now: float) -> tuple[float, float]:
    """Angle and speed [rad], [rad/s] of the motion of the campaign at a time [s]."""
    turn = 2.0 * math.pi * FREQUENCY
    angle = turn * (now - START_UP)
    return AMPLITUDE * math.sin(angle), AMPLITUDE * turn * math.cos(angle)
