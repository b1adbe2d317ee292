"""Gives one valve a set point for a few seconds, to find out which muscle it fills.

This is for bringing up a robot, without the driver and most of its checks. So it asks before it
sends anything, refuses while another driver commands the boards, and vents after a short time, when
the pressure exceeds a limit, when a measurement is missing or a board reports anything.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import Final, NamedTuple

from pam_driver.board_set import BoardSet, Port
from pam_driver.boards.protocol import NEVER, MuscleWire
from pam_driver.boards.wiring import RigWiring
from pam_driver.buses import bus_of_options, open_buses
from pam_driver.driver_settings import DriverSettings
from pam_driver.joint_velocity import JointVelocity
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig

_CYCLE: Final = 0.002  # s
_LISTEN: Final = 0.3  # s
_PATIENCE: Final = 5.0  # s, until the boards are ready
_EMPTYING: Final = 1.0  # s, during which set points that vent are sent at the end
_LINE_PERIOD: Final = 0.2  # s


class PressureCourse(NamedTuple):
    """What happened: pressures before, highest and at the end [Pa gauge]; why it ended early."""

    before: float
    highest: float
    last: float
    stopped: str


class ValveTrial:
    """One valve that follows a set point, while all others vent.

    Parameters
    ----------
    ports : mapping of str to Port
        Open buses by name.
    limit : float
        Pressure above which the trial ends [Pa gauge].
    """

    def __init__(
        self,
        rig: Rig,
        wiring: RigWiring,
        ports: Mapping[str, Port],
        wire: MuscleWire,
        limit: float,
    ) -> None:
        self._settings = DriverSettings()
        velocities = [
            JointVelocity(self._settings.velocity_bandwidth, self._settings.sensor_timeout)
            for _ in rig.joints
        ]
        self._boards = BoardSet(wiring, ports, velocities)
        self._wire, self._limit = wire, limit
        self._vented = tuple(
            0.0 if muscle.valve.kind == "pressure_regulator" else -1.0 for muscle in rig.muscles
        )

    def listen(self) -> None:
        """Send nothing for a moment.

        Raises
        ------
        PamError
            If another driver commands the boards.
        """
        end = time.monotonic() + _LISTEN
        while time.monotonic() < end:
            self._receive()
            if self._boards.foreign_at != NEVER:
                raise PamError("another driver commands the boards of this rig; end it first")

    def prepare(self) -> None:
        """Vent all valves until every board is ready.

        Raises
        ------
        PamError
            If a board is missing or reports a fault.
        """
        end = time.monotonic() + _PATIENCE
        while True:
            now = self._receive()
            self._boards.command(None, now)
            wrong = self._wrong(now, moving=False)
            if not wrong and self._pressure(now) is not None:
                return
            if now > end:
                raise PamError(wrong or f"{self._wire.muscle.name}: no pressure is received")

    def hold(self, fraction: float, seconds: float) -> PressureCourse:
        """Follow a set point, as a fraction of full scale, for so many seconds."""
        setpoints = list(self._vented)
        setpoints[self._wire.place] = fraction
        start = now = time.monotonic()
        before = highest = last = self._pressure(now) or 0.0
        line_at, stopped = start, ""
        while now - start < seconds and not stopped:
            now = self._receive()
            self._boards.command(setpoints, now)
            pressure = self._pressure(now)
            moving = now - start > self._settings.board_timeout
            stopped = self._wrong(now, moving=moving)
            if pressure is None:
                stopped = stopped or f"{self._wire.muscle.name}: no pressure is received"
                continue
            last, highest = pressure, max(highest, pressure)
            if pressure > self._limit:
                stopped = f"{pressure / 1e3:.1f} kPa, the limit is {self._limit / 1e3:.1f} kPa"
            if now >= line_at:
                line_at += _LINE_PERIOD
                print(f"{now - start:5.1f} s  {pressure / 1e3:7.1f} kPa", file=sys.stderr)
        return PressureCourse(before, highest, last, stopped)

    def vent(self) -> None:
        """Vent all valves, and repeat the command for a moment."""
        now = time.monotonic()
        self._boards.vent(now)
        self._boards.command(None, now)
        end = now + _EMPTYING
        while now < end:
            now = self._receive()
            self._boards.command(None, now)

    def _receive(self) -> float:
        time.sleep(_CYCLE)
        now = time.monotonic()
        self._boards.receive(now, time.time())
        return now

    def _pressure(self, now: float) -> float | None:
        samples, channel = self._boards.pressures[self._wire.place]
        sample = samples[channel]
        fresh = now - sample.time <= self._settings.sensor_timeout
        return sample.value if fresh else None

    def _wrong(self, now: float, *, moving: bool) -> str:
        settings = self._settings
        found = [
            str(condition)
            for board in self._boards.boards.values()
            for condition in board.conditions(
                now, settings.board_timeout, settings.sensor_timeout, moving
            )
            if condition.kind != "board_restarted"
        ]
        if self._boards.foreign_at > now - 1.0:
            found.append("another driver commands the boards of this rig")
        return "; ".join(found)


def find_valve(wiring: RigWiring, board: str, channel: str) -> MuscleWire:
    """The valve on a channel of a board, both as the rig file names them.

    Raises
    ------
    PamError
        If there is none; the message lists those that there are.
    """
    known = []
    for address, wired in wiring.boards.items():
        for wire in wired.valves:
            if (str(address), str(wire.channel)) == (board, channel):
                return wire
            known.append(f"{address} {wire.channel} ({wire.muscle.name})")
    raise PamError(f"{board} {channel}: no such valve in the rig file; it has {', '.join(known)}")


def run(given: Arguments) -> Outcome:
    """The command `set`.

    Raises
    ------
    PamError
        If the valve is unknown, the user does not confirm, or the robot is not ready; nothing has
        moved.
    """
    rig = load_rig(given.rig_file)
    wiring = RigWiring(rig, {"dbc": str(given.dbc or "")})
    wire = find_valve(wiring, given.board, given.channel_name)
    fraction = given.percent / 100.0
    lowest = 0.0 if wire.muscle.valve.kind == "pressure_regulator" else -1.0
    if not lowest <= fraction <= 1.0:
        raise PamError(
            f"{given.percent:g} %: the valve of {wire.muscle.name} takes {100.0 * lowest:g} to "
            "100 %"
        )
    limit = min(given.limit, wire.muscle.max_pressure)
    if not given.yes:
        print(
            f"{wire.muscle.name} gets {given.percent:g} % for {given.duration:g} s or up to "
            f"{limit / 1e3:g} kPa; the joint moves. Type yes: ",
            end="",
            file=sys.stderr,
            flush=True,
        )
        if sys.stdin.readline().strip() != "yes":
            raise PamError("not confirmed; nothing was sent")
    only = bus_of_options(rig, given.interface, given.channel, given.port)
    ports = open_buses(rig, wiring, only)
    try:
        trial = ValveTrial(rig, wiring, ports, wire, limit)
        trial.listen()
        try:
            trial.prepare()
            course = trial.hold(fraction, given.duration)
        finally:
            trial.vent()
    finally:
        for port in ports.values():
            port.close()
    print(
        f"{wire.muscle.name}: {course.before / 1e3:.1f} kPa before, at most "
        f"{course.highest / 1e3:.1f} kPa, vented"
    )
    if course.stopped:
        print(f"ended early: {course.stopped}")
    document = {
        "muscle": wire.muscle.name,
        "board": given.board,
        "channel": given.channel_name,
        "percent": given.percent,
        "pressure_before": course.before,
        "pressure_highest": course.highest,
        "pressure_last": course.last,
        "ended_early": course.stopped,
    }
    return Outcome(document, [course.stopped] if course.stopped else [])
