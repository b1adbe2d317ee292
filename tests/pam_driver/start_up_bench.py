"""Partners of the start-up check: a hand that answers its pulses, and a simulated rig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pam_check.faults.chain import VirtualCan
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.start_up_check import StartUpCheck
from pam_driver.safety.states import SafetyState
from pam_model.identify.size import size_joint, sized_rig
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose
from pam_sim.boards.protocol import BoardSettings
from pam_sim.simulated_rig import SimulatedRig

TICK = 0.002  # s, a cycle of the driver
STEP = 1e-3  # s, of the simulated rig
PATIENCE = 30.0  # s
PAUSES = ("between two cycles", "before the frames are read", "before the commands are sent")


@dataclass
class Desk:
    """Answers the check's set points with sensor readings, by hand.

    Each muscle fills with the fraction of its own valve, as `answers` says: which pressure a
    sensor shows for the air in all muscles is up to `shows`, which angle up to `turns`.
    """

    rig: Rig
    check: StartUpCheck
    answers: Sequence[Callable[[float], float]]
    shows: Callable[[list[float]], list[float]] = field(default=list)
    turns: Callable[[list[float]], float] = field(default=lambda air: 0.0)
    now: float = 0.0

    def run(self, until: float = 60.0) -> list[tuple[float, ...]]:
        """The set points of every cycle until the check has ended."""
        told = []
        air = [0.0] * len(self.rig.muscles)
        self.check.start(self.now)
        while not self.check.finished:
            self.now += TICK
            angles = [self.turns(air)] * len(self.rig.joints)
            told.append(self.check.setpoints(self.shows(air), angles, self.now))
            air = [
                answer(fraction) if fraction > 0.0 else 0.0
                for answer, fraction in zip(self.answers, told[-1], strict=True)
            ]
            assert self.now < until, "the check does not end"
        return told

    @property
    def findings(self) -> list[tuple[str, str]]:
        assert {found.kind for found in self.check.findings} <= {"start_up_check"}
        return [(found.subject, found.text) for found in self.check.findings]


def fills(fraction: float) -> float:
    """A valve whose muscle has the pressure of a pulse soon after it opens."""
    return 4e5 * fraction


def desk_of(elbow: Rig, **given: object) -> Desk:
    check = StartUpCheck(compose(elbow), (-1.0, -0.5))
    return Desk(elbow, check, **({"answers": [fills, fills]} | given))  # type: ignore[arg-type]


class Bench:
    """A simulated rig and a driver with start-up check, which may read another rig file.

    The boards may have another watchdog than theirs [s].
    """

    def __init__(
        self,
        rig: Rig,
        wired: Rig | None = None,
        effects: dict[str, float] | None = None,
        watchdog: float | None = None,
    ) -> None:
        board = BoardSettings(watchdog_period=watchdog)
        self.sim = SimulatedRig(rig, effects=effects, board=board)
        self.can = VirtualCan()
        port = CanPort({"interface": "simulated", "channel": "check"}, self.can)
        settings = DriverSettings(start_up_check=True)
        plausibility = PressurePlausibility(compose(rig), 2.0 * STEP)
        self.driver = Driver(wired or rig, port, settings, plausibility)
        self.now = 0.0
        self.moved = self.highest = 0.0
        self._tick = 0
        self._rest: list[float] = []

    def step(self) -> None:
        self._rig_goes_on()
        if self._tick % 2 == 0:
            self.driver.cycle(self.now, self.now)

    def stand_still(self, duration: float, where: str) -> None:
        """A pause of the driver [s], at one of the places of `PAUSES`; the rig goes on."""
        steps = round(duration / STEP)

        def pause(_: object = None) -> None:
            for _ in range(steps):
                self._rig_goes_on()

        def clock() -> tuple[float, float]:
            return self.now, self.now

        began = self.now
        if where in PAUSES[:2]:
            pause()
        if where == PAUSES[0]:
            began = self.now
        control = pause if where == PAUSES[2] else None
        self.driver.cycle(began, began, clock, control)

    def _rig_goes_on(self) -> None:
        self._tick += 1
        self.now += STEP
        while self.can.to_boards:
            self.sim.on_frame(*self.can.to_boards.popleft(), self.now)
        for frame in self.sim.advance(self.now):
            self.can.deliver(frame, self.now)
        truth = self.sim.ground_truth()
        self._rest = self._rest or truth.positions
        turned = [abs(here - at) for here, at in zip(truth.positions, self._rest, strict=True)]
        self.moved = max(self.moved, *turned)
        self.highest = max(self.highest, *truth.pressures)

    def run(self, until: Callable[[], bool]) -> None:
        end = self.now + PATIENCE
        while not until():
            assert self.now < end
            self.step()

    def check(self) -> list[str]:
        """Activate, and run until the check has ended; its findings."""
        self.run(lambda: self.now > 0.6)
        self.driver.activate(self.now)
        assert self.driver.state is SafetyState.CHECKING
        self.run(lambda: self.driver.state is not SafetyState.CHECKING)
        found = [fault for fault in self.driver.faults if fault.kind == "start_up_check"]
        assert len(found) == len(self.driver.faults)
        return [str(fault) for fault in found]


def exchanged(rig: Rig) -> Rig:
    """The rig file of someone who has exchanged the channels of both muscles."""
    channels = [muscle.channel for muscle in rig.muscles]
    muscles = tuple(
        replace(muscle, channel=channel)
        for muscle, channel in zip(rig.muscles, reversed(channels), strict=True)
    )
    return replace(rig, muscles=muscles)


def free_rig(folder: Path, torque: float, length: float, inertia: float) -> Rig:
    """A horizontal joint: no weight holds it back."""
    path = folder / "rig.yaml"
    size = size_joint(torque, 1.0, 3.0, 5e5, length, 6e5)
    path.write_text(sized_rig(size, 1.0, 5e5, inertia).text(), encoding="utf-8")
    return load_rig(path)
