"""A simulated arm under the driver, without controller: the pressures follow wanted ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_ros.valve_command import ValveCommandFormat
from pam_sim.simulated_rig import GroundTruth, SimulatedRig

STEP = 1e-3
PERIOD = 2e-3


class Wire:
    """A bus that delivers at once, or as a test tells it."""

    def __init__(self) -> None:
        self.state = BusState.ERROR_ACTIVE
        self.to_driver: deque[ReceivedFrame] = deque()
        self.to_boards: deque[tuple[int, bytes]] = deque()

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        frames = list(self.to_driver)
        self.to_driver.clear()
        return frames

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        self.to_boards.append((frame_id, data))
        return SendOutcome.SENT


class ArmBench:
    """Driver and simulated rig on a virtual clock.

    Attributes
    ----------
    wanted : list of float or None
        By muscle, the pressures that flow valves regulate and regulators are told [Pa gauge]; with
        None no command is sent.
    delay_down, delay_up : float
        Transport delay of the frames [s].
    silent : callable
        Whether the measurements of this moment are lost.
    """

    def __init__(
        self,
        rig: Rig,
        settings: DriverSettings | None = None,
        effects: Mapping[str, float] | None = None,
    ) -> None:
        self.rig = rig
        self.now = 100.0
        self.wire = Wire()
        self.sim = SimulatedRig(rig, effects=effects, now=self.now)
        plausibility = PressurePlausibility(compose(rig), PERIOD)
        self.driver = Driver(rig, self.wire, settings or DriverSettings(), plausibility)
        self.wanted: list[float] | None = None
        self.delay_down = self.delay_up = 0.0
        self.silent: Callable[[float], bool] = lambda now: False
        self._format = ValveCommandFormat(rig.valve_kinds)
        self._flow = [kind == "flow" for kind in rig.valve_kinds.values()]
        self._down: deque[tuple[float, tuple[int, bytes]]] = deque()
        self._up: deque[tuple[float, tuple[int, bytes]]] = deque()
        self._ticks = 0

    @property
    def truth(self) -> GroundTruth:
        return self.sim.ground_truth()

    @property
    def valve_commands(self) -> list[float]:
        return [value for board in self.sim.boards.values() for value in board.valve_commands]

    def step(self, seconds: float = STEP) -> None:
        for _ in range(max(1, round(seconds / STEP))):
            self._tick()

    def hold(self, pressures: list[float], seconds: float = 4.0) -> None:
        """Activate, and hold these pressures."""
        self.step(0.3)
        self.driver.activate(self.now)
        for part in range(1, 101):  # slowly, so that no joint exceeds its speed
            self.wanted = [part / 100.0 * pressure for pressure in pressures]
            self.step(0.01)
        self.wanted = pressures
        self.step(max(seconds - 1.0, 0.0))
        assert self.driver.state is SafetyState.ACTIVE, self.driver.faults

    def _tick(self) -> None:
        self._ticks += 1
        self.now += STEP
        while self.wire.to_boards:
            self._down.append((self.now + self.delay_down, self.wire.to_boards.popleft()))
        while self._down and self._down[0][0] <= self.now:
            self.sim.on_frame(*self._down.popleft()[1], self.now)
        lost = self.silent(self.now)
        for frame in self.sim.advance(self.now):
            if not lost:
                self._up.append((self.now + self.delay_up, frame))
        while self._up and self._up[0][0] <= self.now:
            frame_id, data = self._up.popleft()[1]
            self.wire.to_driver.append(ReceivedFrame(frame_id, data, self.now))
        if self._ticks % 2:
            return
        commandable = self.driver.state in {SafetyState.READY, SafetyState.ACTIVE}
        if self.wanted is not None and commandable:
            values = [
                min(max((wanted - measured) / 1e5, -1.0), 1.0) if flow else wanted
                for flow, wanted, measured in zip(
                    self._flow, self.wanted, self.truth.pressures, strict=True
                )
            ]
            position, effort = self._format.pack(values)
            command = NamedCommand(self.rig.muscle_names, position, (), effort)
            self.driver.set_commands(command, self.now)
        self.driver.cycle(self.now, self.now)
