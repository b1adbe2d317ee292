"""Driver, board and controller on one bus and one clock, small enough to visit all their states.

Real are: the `Driver` with its table of states, its fault judge and its command intake, the
`StartUp` of its process, the driver's board with its codec and frames, the simulated twin of the
board with its watchdog and its latch, the `ReferenceGenerator`, and the messages and the rule by
which a controller follows the driver's state.

Abstracted are:

- Time passes in steps (`TICK`), in which everything runs once. Time-outs are a few steps long.
- The lifecycle node around the driver is replaced by `DriverProcess`, whose methods do what the
  node's callbacks do, without ROS.
- The control law is replaced by two set points: one that holds the joint, one that follows a
  reference of the user.
- A muscle is full as long as its valve does not vent, and empty one step later. The joint does not
  move. Faults last one step: a pressure that only the driver finds too high, and a reading that is
  missing, which driver and board find. The comparison with physics and the start-up check are
  switched off, because they need a plant that moves.
- Frames take no time, messages take one step. One valve command at a time may be held up for as
  long as one likes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Final

from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.trajectory import TrajectoryPoint
from pam_driver.boards.pam_board.codec import BoardCodec, BoardState
from pam_driver.boards.wiring import RigWiring, kind_name
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import ActivationError, Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import OUTPUTS, SafetyState
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand
from pam_driver.snapshot import Snapshot
from pam_driver.start_up import Advice, StartUp
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.driver_state import COMMANDABLE
from pam_sim.boards.pam_board_twin import SimulatedPamBoard
from pam_sim.boards.protocol import BoardSettings, BoardValve

TICK: Final = 2.0**-5
"""One step of time [s]; a sum of powers of two, so that equal ages are equal numbers."""
LONGEST: Final = 3
"""Every time-out is shorter than so many steps."""
ORIGIN: Final = 1e9
"""Start of the clock [s]; larger than every other number, so that times are recognised."""
HOLD, FOLLOW = 0.25, 0.5
FULL: Final = 1e5
"""Pressure of a muscle that does not vent [Pa gauge]; one that vents is empty after a step."""
SUPPLY: Final = 701_325.0

DRIVER_SETTINGS: Final = DriverSettings(
    command_timeout=2.5 * TICK,
    board_timeout=2.5 * TICK,  # of boards that send in every step
    sensor_timeout=1.5 * TICK,
    exhaust_timeout=2.5 * TICK,
    lowering_timeout=1.5 * TICK,
    loop_delay_limit=10.0 * TICK,
)
BOARD_SETTINGS: Final = BoardSettings(
    measurement_rate=1.0 / TICK,
    status_rate=1.0 / TICK,
    heartbeat_rate=1.0 / TICK,
    watchdog_period=1.5 * TICK,
    boot_time=0.5 * TICK,
)


class DirectWire:
    """A bus between the driver and the board; the board hears a frame when it is sent."""

    state = BusState.ERROR_ACTIVE

    def __init__(self, board: SimulatedPamBoard) -> None:
        self.board = board
        self.to_driver: list[ReceivedFrame] = []

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        """The frames for the driver."""
        waiting, self.to_driver = self.to_driver, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Give a frame to the board."""
        self.board.on_frame(frame_id, data, now)
        return SendOutcome.SENT


class DriverProcess:
    """The driver's process: what the node does for its callers, without ROS."""

    def __init__(self, rig: Rig, wiring: RigWiring, wire: DirectWire) -> None:
        self.driver: Driver | None = None
        self.start_up = StartUp()
        self.active = False
        self._rig, self._wiring, self._wire = rig, wiring, wire

    @property
    def state(self) -> SafetyState:
        """The state that the node publishes."""
        return SafetyState.UNCONFIGURED if self.driver is None else self.driver.state

    def configure(self) -> None:
        """Open the bus and measure."""
        self.driver = Driver(self._rig, self._wire, DRIVER_SETTINGS, wiring=self._wiring)

    def autostart(self, activates: bool, now: float) -> None:
        """Configure, and activate when the board answers if that is asked for."""
        self.configure()
        self.start_up.begin(now + (LONGEST - 0.5) * TICK, activates)

    def activate(self, now: float) -> bool:
        """Activate; whether that was possible."""
        assert self.driver is not None
        try:
            self.start_up.activate(self.driver, now)
        except ActivationError:
            return False
        self.active = True
        return True

    def deactivate(self, now: float) -> None:
        """The lifecycle transition."""
        assert self.driver is not None
        self.active = False
        self.driver.deactivate(now)

    def vent(self, now: float) -> None:
        """The service."""
        assert self.driver is not None
        self.driver.vent(now)
        self.start_up.cancel()

    def clear_faults(self, now: float) -> None:
        """The service."""
        assert self.driver is not None
        self.start_up.clear_faults(self.driver, now)

    def close(self, now: float) -> None:
        """Clean up, or end after a signal."""
        driver, self.driver = self.driver, None
        if driver is not None:
            self.start_up.leave(driver)
            driver.close(now)
        self.active = False

    def cycle(self, now: float, control: Callable[[Snapshot], object] | None = None) -> bool:
        """The node's watch, then a cycle of the I/O thread; whether it has activated itself."""
        if self.driver is None:
            return False
        if self.active and self.driver.state.value not in COMMANDABLE:
            self.deactivate(now)
        if self.active:
            self.start_up.end()
        step = self.start_up.step(self.driver, now)
        activated = step.advice is Advice.ACTIVATE and self.activate(now)
        self.driver.cycle(now, now, control=control)
        return activated


class ControllerProcess:
    """The controller's process: references in, commands out while the driver takes them."""

    def __init__(self, rig: Rig) -> None:
        self.active = False
        self.heard = ""  # the driver's state in the last message
        self.references = ReferenceGenerator(
            {joint.name: joint.position_limits for joint in rig.joints}
        )
        self._rig = rig

    @property
    def follows(self) -> bool:
        """Whether it follows a reference of the user."""
        return self.active and self.references.following(self._rig.joint_names[0]) != "hold"

    def key(self) -> Hashable:
        """All that distinguishes two controllers; the course of a reference does not."""
        return self.active, self.heard, self.references.following(self._rig.joint_names[0])

    def hear(self, state: str) -> None:
        """The driver's state; while it takes no commands, the references are dropped."""
        self.heard = state
        if state not in COMMANDABLE:
            self.active = False

    def take_reference(self, now: float) -> bool:
        """A reference of the user; whether it was accepted."""
        if not self.active:
            return False
        names = self._rig.joint_names
        points = [TrajectoryPoint(TICK, [0.1] * len(names))]
        self.references.follow(names, points, start=None, now=now)
        return True

    def step(self, now: float) -> NamedCommand | None:
        """One control cycle; `age` is the time at which the command is computed."""
        if self.heard not in COMMANDABLE:
            return None
        if not self.active:
            self.references.hold(dict.fromkeys(self._rig.joint_names, 0.0))
            self.active = True
        value = FOLLOW if self.follows else HOLD
        return NamedCommand(self._rig.muscle_names, [value] * len(self._rig.muscles), age=now)


@dataclass(slots=True)
class System:
    """Everything that runs, at one moment; `make_system` makes it.

    Attributes
    ----------
    now : float
        Time [s].
    driver, controller : process or None
        None: not running.
    published : str
        The last message of the driver on `~/state`.
    command, held : NamedCommand or None
        A valve command on its way, and one that is held up; `age` is the time it was computed. One
        that is older than `command_timeout` is refused, so it is forgotten.
    powered_at : float
        When the board was switched on [s].
    one_process : bool
        Driver and controller are one process: they start and end together, and share a cycle.
    disturbance : float
        What the first pressure sensor shows in the next step instead of the pressure [Pa]; NaN:
        nothing; 0: there is none.
    """

    rig: Rig
    wiring: RigWiring
    wire: DirectWire
    one_process: bool = False
    now: float = ORIGIN
    driver: DriverProcess | None = None
    controller: ControllerProcess | None = None
    published: str = ""
    command: NamedCommand | None = None
    held: NamedCommand | None = None
    disturbance: float = 0.0
    powered_at: float = ORIGIN
    activated_itself: bool = False
    accepted: list[float] = field(default_factory=list)

    @property
    def board(self) -> SimulatedPamBoard:
        """The board on the bus."""
        return self.wire.board

    @property
    def opening(self) -> float:
        """The widest opening of a valve to the supply, 0 if none is open."""
        return max(0.0, *self.board.valve_commands)

    @property
    def board_faulty(self) -> bool:
        """Whether the board has latched a fault."""
        return self.board.state is BoardState.FAULT

    @property
    def driver_faulty(self) -> bool:
        """Whether the driver's process knows of a fault that has not been cleared."""
        process = self.driver
        if process is None:
            return False
        return bool(process.start_up.latched) or process.state.value.startswith("fault")

    @property
    def driver_moves(self) -> bool:
        """Whether the driver lets the valves follow commands."""
        return self.driver is not None and OUTPUTS[self.driver.state].enable

    def deliver(self, command: NamedCommand) -> None:
        """Give the driver a valve command; the time at which an accepted one was computed is kept.

        The age of a command is that at its arrival, as in the driver's node.
        """
        driver = None if self.driver is None else self.driver.driver
        if driver is None:
            return
        try:
            driver.set_commands(command._replace(age=self.now - command.age), self.now)
        except CommandRefusedError:
            return
        self.accepted.append(command.age)

    def publish(self) -> None:
        """The driver publishes its state when it has changed; a dead one says nothing."""
        if self.driver is not None:
            self.published = self.driver.state.value
            if self.one_process and self.controller is not None:
                self.controller.hear(self.published)

    def control(self, _: Snapshot) -> None:
        """The controller's part in the driver's cycle."""
        command = None if self.controller is None else self.controller.step(self.now)
        if command is not None:
            self.deliver(command)

    def tick(self) -> None:
        """Let time pass: boards, driver and controller run once."""
        self.now += TICK
        heard = self.published
        if self.command is not None:
            self.deliver(self.command)
            self.command = None
        pairs = zip(self.board.valve_commands, self.board.valves, strict=True)
        pressures = [0.0 if command == valve.vented else FULL for command, valve in pairs]
        pressures[0] = self.disturbance or pressures[0]
        self.disturbance = 0.0
        for frame_id, data in self.board.poll(self.now, pressures, (0.0,), SUPPLY):
            self.wire.to_driver.append(ReceivedFrame(frame_id, data, self.now))
        if self.driver is not None:
            control = self.control if self.one_process else None
            self.activated_itself = self.driver.cycle(self.now, control)
            self.publish()
        else:
            self.published = ""
        self.wire.to_driver.clear()
        if self.held is not None and self.now - self.held.age > DRIVER_SETTINGS.command_timeout:
            self.held = None
        if self.controller is not None and not self.one_process:
            if heard:
                self.controller.hear(heard)
            self.command = self.controller.step(self.now)


def make_system(rig: Rig, *, one_process: bool = False) -> System:
    """The parts before anything has been started; the board has power.

    Parameters
    ----------
    rig : Rig
        A rig with one board and flow valves.
    one_process : bool, optional
        As in `System`.

    Raises
    ------
    PamError
        For another rig.
    """
    wiring = RigWiring(rig)
    kinds = {kind_name(wired) for wired in wiring.boards.values()}
    flow = all(muscle.valve.kind == "flow" for muscle in rig.muscles)
    if len(wiring.boards) != 1 or kinds != {"pam_board"} or not flow:
        raise PamError("the walk needs a rig with one pam_board and flow valves")
    (wired,) = wiring.boards.values()
    board = SimulatedPamBoard(
        0,
        BoardCodec.from_dbc(),
        BOARD_SETTINGS,
        [BoardValve.of(wire.muscle) for wire in wired.valves],
        [int(wire.channel) for wire in wired.valves],
        ORIGIN,
    )
    return System(rig, wiring, DirectWire(board), one_process)


def too_high(rig: Rig) -> float:
    """A pressure that the driver refuses and the board accepts [Pa gauge]."""
    return rig.muscles[0].max_pressure + 2.0 * DRIVER_SETTINGS.over_pressure_margin


MISSING: Final = math.nan
