"""Moves sixteen muscles on simulated boards for hours, and looks for leaks and drift.

`pam check soak --hours 2` runs boards, plant, the driver's bus port, driver and
controller at 500 Hz and the model at 100 Hz in one process on a virtual clock. The wall clock is
50 ppm faster than the monotonic clock, as with an uncorrected quartz crystal. The run checks
memory, handles, threads, stamps, heartbeats and commands. It does not cover sockets, ROS messages
and the timing of the operating system. After SIGINT it reports the results up to that time.
"""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Final

from pam_check.endurance.process_use import Use, use_of
from pam_check.faults.chain import AMPLITUDE, FaultChain
from pam_control.controller import Controller
from pam_control.controller_parameters import create_controller, parameter_table
from pam_driver.boards.pam_board.board import PamBoard
from pam_driver.boards.pam_board.codec import BoardCodec, Heartbeat
from pam_driver.safety.states import SafetyState
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Encoder, Rig, load_rig
from pam_sim.boards.protocol import BoardSettings

PERIOD: Final = 0.002  # s
MODEL_CYCLES: Final = 5  # driver cycles between two estimates
WALL_START: Final = 1.8e9  # s; a realistic value, so that stamps have realistic rounding errors
WALL_RATE: Final = 1.0 + 50e-6  # rate of the wall clock relative to the monotonic one
HEARTBEAT_PERIOD: Final = 1.0 / BoardSettings().heartbeat_rate
MEMORY_ALLOWED: Final = 1.05
DRIFT_ALLOWED: Final = 1e-5  # s
SETTLED: Final = 0.1  # share of the run until caches are filled


@dataclass(slots=True)
class Lag:
    """How far stamps are behind their clock [s]."""

    first: float = math.nan
    lowest: float = math.inf
    highest: float = -math.inf

    def add(self, lag: float) -> None:
        """Add a stamp."""
        if math.isnan(self.first):
            self.first = lag
        self.lowest, self.highest = min(self.lowest, lag), max(self.highest, lag)

    @property
    def drift(self) -> float:
        """The largest deviation from the first value [s]."""
        return max(self.highest - self.first, self.first - self.lowest)


@dataclass(slots=True)
class SoakResult:
    """Result of a soak test."""

    seconds: float  # virtual time with air flow [s]
    elapsed: float  # processor time [s]
    # before, after: resources of the process after a tenth of the run and at the end
    before: Use
    after: Use
    # stamps, times: lag of stamps behind the wall clock, and of sample times behind the monotonic
    # clock
    stamps: Lag
    times: Lag
    # heartbeats, missed_heartbeats: received heartbeats, and those that are missing between them
    heartbeats: int
    missed_heartbeats: int
    refused: int  # commands that the driver or the boards refused
    frames_lost: int  # lost measurement frames
    # largest deviation of an angle from its reference after the first second [rad]
    worst_error: float
    stopped: str  # why the run ended early; empty if it did not
    interrupted: bool = False  # whether the user ended the run

    def problems(self) -> list[str]:
        """The results that are out of bounds, one line each."""
        checks = {
            self.stopped: bool(self.stopped),
            "memory grows": self.after.memory > MEMORY_ALLOWED * self.before.memory,
            "file handles grow": self.after.handles != self.before.handles,
            "threads grow": self.after.threads != self.before.threads,
            "stamps drift": not all(
                lag.drift <= DRIFT_ALLOWED for lag in (self.stamps, self.times)
            ),
            "heartbeats missed": self.missed_heartbeats > 0,
            "no heartbeat received": self.heartbeats == 0,
            "commands refused": self.refused > 0,
            "measurements lost": self.frames_lost > 0,
            "the joints do not follow": not self.worst_error < AMPLITUDE,
        }
        return [text for text, bad in checks.items() if bad]

    def __str__(self) -> str:
        grown = 100.0 * (self.after.memory / self.before.memory - 1.0)
        return "\n".join(
            [
                f"{self.seconds:.0f} s of motion, {self.elapsed:.0f} s of processor time",
                f"memory at {100.0 * SETTLED:.0f} %: {self.before.memory / 2**20:.1f} MiB, at the "
                f"end: {self.after.memory / 2**20:.1f} MiB ({grown:+.1f} %)",
                f"file handles {self.before.handles} to {self.after.handles}, "
                f"threads {self.before.threads} to {self.after.threads}",
                f"stamps against the wall clock: drift {1e6 * self.stamps.drift:.2f} us; "
                f"times against the monotonic clock: drift {1e6 * self.times.drift:.2f} us",
                f"heartbeats: {self.heartbeats} received, {self.missed_heartbeats} missed",
                f"commands refused: {self.refused}; measurements lost: {self.frames_lost}",
                f"largest angle error: {self.worst_error:.3f} rad",
            ]
        )


def widened(rig: Rig, joints: int) -> Rig:
    """A rig with `joints` copies of the first joint, each with its own valve board.

    Raises
    ------
    PamError
        If a bus cannot have so many boards.
    """
    boards = BoardCodec.from_dbc().board_count
    if not 1 <= joints <= boards:
        raise PamError(f"joints = {joints}: expected 1 to {boards}, since each has its own board")
    if not rig.joints:
        raise PamError("the rig file has no joint")
    model = rig.joints[0]
    copies, muscles = [], []
    for number in range(joints):
        names = tuple(f"{muscle}_{number}" for muscle in model.muscles)
        copies.append(
            replace(
                model,
                name=f"{model.name}_{number}",
                muscles=(names[0], names[1]),
                encoder=Encoder(number),
            )
        )
        for channel, (name, old) in enumerate(zip(names, model.muscles, strict=True)):
            muscles.append(replace(rig.muscle(old), name=name, board=number, channel=channel))
    return replace(rig, joints=tuple(copies), muscles=tuple(muscles))


class SoakChain(FaultChain):
    """The chain in steps of the driver's cycle; its clocks accumulate no rounding errors."""

    def __init__(self, rig: Rig, controller: Controller) -> None:
        super().__init__(rig, controller)
        self._cycles = 0

    def step(self) -> None:
        """One cycle; the driver receives what the boards sent in the cycle before."""
        self._cycles += 1
        self.now = self._cycles * PERIOD
        self.wall = WALL_START + self.now * WALL_RATE
        self._deliver()
        self.hear(self.driver.cycle(self.now, self.wall))
        if self._cycles % MODEL_CYCLES == 0:
            self._estimate()
        self._control()
        self._bus()


class _Interrupted:
    """Catches SIGINT, so that a run that is ended early still reports its results."""

    def __init__(self) -> None:
        self.yes = False
        self._before = signal.signal(signal.SIGINT, self._note)

    def _note(self, *_: object) -> None:
        self.yes = True

    def end(self) -> None:
        """Restore the handler of SIGINT."""
        signal.signal(signal.SIGINT, self._before)


def _pam_boards(chain: FaultChain) -> list[PamBoard]:
    """The driver's boards; `widened` creates boards of this kind only."""
    return [board for board in chain.driver.boards.values() if isinstance(board, PamBoard)]


class _Heartbeats:
    """Counts the heartbeats that the driver receives from each board."""

    def __init__(self, chain: FaultChain) -> None:
        self._boards = _pam_boards(chain)
        self._last: list[Heartbeat | None] = [board.heartbeat for board in self._boards]
        self._at = [chain.now] * len(self._last)
        self.received = 0
        self.missed = 0

    def look(self, now: float, end: bool = False) -> None:
        for index, board in enumerate(self._boards):
            new = board.heartbeat is not self._last[index]
            if not (new or end):
                continue
            # at the end of the run, an overdue heartbeat counts as missed
            due = (now - self._at[index]) / HEARTBEAT_PERIOD
            self.missed += max(0, round(due) - 1 if new else math.floor(due - 0.5))
            if new:
                self.received += 1
                self._last[index], self._at[index] = board.heartbeat, now


def soak(
    rig: Rig, seconds: float, tell: Callable[[float], None] = lambda share: None
) -> SoakResult:
    """Move all joints of a rig back and forth.

    Parameters
    ----------
    rig : Rig
        See `widened`.
    seconds : float
        Virtual time [s].
    tell : callable, optional
        Called a hundred times with the finished share.

    Raises
    ------
    PamError
        If the chain cannot be started.
    """
    names = rig.joint_names
    values = {entry.name: entry.default for entry in parameter_table(names)}
    chain = SoakChain(rig, create_controller(rig, values, names))
    chain.start()
    cycles = max(round(seconds / PERIOD), 100)
    start = time.process_time()
    stamps, times, beats = Lag(), Lag(), _Heartbeats(chain)
    worst, stopped, done = 0.0, "", 0
    before = use_of()
    driver, driven = chain.driver, _pam_boards(chain)
    interrupted = _Interrupted()
    for done in range(1, cycles + 1):
        chain.step()
        seen = chain.snapshot
        assert seen is not None
        stamps.add(chain.wall - min(seen.joint_stamp, seen.pressure_stamp))
        times.add(chain.now - min(board.position.time for board in driven))
        beats.look(chain.now)
        worst = max(worst, *(abs(angle - chain.reference) for angle in seen.positions))
        if driver.state is not SafetyState.ACTIVE:
            stopped = f"after {done * PERIOD:.3f} s: " + "; ".join(map(str, driver.faults))
            break
        if interrupted.yes:
            stopped = f"interrupted after {done * PERIOD:.0f} s"
            break
        if done == round(SETTLED * cycles):
            before = use_of()
        if done % max(cycles // 100, 1) == 0:
            tell(done / cycles)
    interrupted.end()
    beats.look(chain.now, end=True)
    boards = chain.sim.boards.values()
    if not stopped and not all(board.active for board in boards):
        stopped = "a board is not active"
    return SoakResult(
        seconds=done * PERIOD,
        elapsed=time.process_time() - start,
        before=before,
        after=use_of(),
        stamps=stamps,
        times=times,
        heartbeats=beats.received,
        missed_heartbeats=beats.missed,
        refused=chain.noticed.total() + sum(board.rejected_frames for board in boards),
        frames_lost=sum(board.frames_lost for board in driven),
        worst_error=worst,
        stopped=stopped,
        interrupted=interrupted.yes,
    )


def run(given: Arguments) -> Outcome:
    """Run the soak test and print its result; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig or a number of joints that cannot be used.
    """
    rig = widened(load_rig(chosen_rig(given)), given.joints)
    with progress(1.0, "soak") as bar:
        result = soak(rig, 3600.0 * given.hours, bar.show)
    print(
        f"{len(rig.muscles)} muscles on {len(rig.joints)} boards at {1.0 / PERIOD:.0f} Hz: {result}"
    )
    problems = result.problems()
    for problem in problems:
        print(f"OUT OF BOUNDS: {problem}", file=sys.stderr)
    return Outcome({**asdict(result), "problems": problems}, problems, result.interrupted)
