"""Finds what is wrong with buses, boards, sensors and commands, and what contradicts physics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple, Protocol

from pam_driver.board_set import BoardSet, host_fault_of
from pam_driver.boards.availability import WINDOW
from pam_driver.boards.protocol import NEVER, Board, Condition
from pam_driver.can_bus.bus import BusState
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.joint_speed import JointSpeedWatch
from pam_driver.safety.loop_watch import LoopWatch
from pam_driver.safety.pauses import longest_gap
from pam_driver.safety.pressure_plausibility import LONGEST_GAP, Deviation
from pam_driver.safety.sensor_checks import SensorChecks
from pam_driver.safety.since_judged import SinceJudged
from pam_model.robot import Robot

# A command of another driver is a fault for this long after it was received [s].
_FOREIGN_MEMORY: Final = 1.0
# The physics is blind if it restarted more than so often within this time [s].
_RESTARTS: Final = 3
_RESTART_MEMORY: Final = 1.0
# Time after a pause of the driver within which faults may be caused by it [s].
_PAUSE_MEMORY: Final = 0.1


class PlausibilityCheck(Protocol):
    """Compares measurements with physics, see `pam_driver.safety.pressure_plausibility`."""

    period: float

    def update(
        self,
        commands: Sequence[float],
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
        supply_pressures: Sequence[float],
    ) -> None:
        """Advance by one cycle."""

    @property
    def restarts(self) -> int:
        """How often the check has restarted after a gap in the measurements."""

    def restart(self) -> None:
        """Restart after a pause."""

    def deviations(self) -> Iterable[Deviation]:
        """The deviations between measurements and physics."""


class Readings(NamedTuple):
    """The measurements, in the rig's order; NaN where they are too old."""

    pressures: Sequence[float]
    positions: Sequence[float]
    velocities: Sequence[float]


class CommandedMotion(NamedTuple):
    """Whether the driver moves the valves, and by which command."""

    # whether the valves follow commands; they do not while the driver itself lowers the joints
    commanded: bool
    # since when the boards are commanded to be active, monotonic [s]; infinite while not
    since: float
    command_time: float  # when the command in use was computed, monotonic [s]
    last_rejection: str  # why the last refused command was refused


class _Sensors(NamedTuple):
    """Sensors, by their places in the rig's order."""

    pressures: Sequence[int]
    angles: Sequence[int]


class FaultJudge:
    """Finds what is wrong with a rig while the driver runs.

    Parameters
    ----------
    robot : Robot
        Gives the limits and the physics.
    boards : BoardSet
        The boards with their last measurements.
    settings : DriverSettings
        Limits and time-outs.
    vents : sequence of float
        By muscle the fraction of full scale at which its valve vents.
    plausibility : PlausibilityCheck, optional
        Compares measurements with physics; without it, they are only compared with limits.

    Attributes
    ----------
    suspicions : tuple of Condition
        Deviations above the warning share of a plausibility limit.
    loop : LoopWatch
        The delays of the control loop.
    """

    def __init__(
        self,
        robot: Robot,
        boards: BoardSet,
        settings: DriverSettings,
        vents: Sequence[float],
        plausibility: PlausibilityCheck | None = None,
    ) -> None:
        self.suspicions: tuple[Condition, ...] = ()
        self.loop = LoopWatch(settings.loop_delay_limit, settings.period)
        rig = robot.rig
        self._speeds = JointSpeedWatch(robot)
        self._kept = SinceJudged()
        self._sensor_names = (*rig.muscle_names, *rig.joint_names)
        self._all_sensors = _Sensors(range(len(boards.pressures)), range(len(boards.angles)))
        self._sensors_of = {
            board.name: _Sensors(
                [i for i, (of, _) in enumerate(boards.pressures) if of is board.pressures],
                [i for i, (of, _) in enumerate(boards.angles) if of is board.angles],
            )
            for board in boards.boards.values()
        }
        self._rig = rig
        self._boards = boards
        self._settings = settings
        self._plausibility = plausibility
        self._checks = None if plausibility is None else SensorChecks(robot)
        self._implausible: tuple[Condition, ...] = ()
        self._judged_at = self._paused_at = NEVER
        self._pause = 0.0
        self._air_since = math.inf
        self._sampled_at = [NEVER] * len(rig.muscles)
        self._restarted_at: list[float] = []
        self._vents = vents
        self._limits = tuple(
            muscle.max_pressure + settings.over_pressure_margin for muscle in rig.muscles
        )
        margin = rig.plausibility.position_margin
        self._ranges = tuple(
            (low - margin, high + margin)
            for low, high in (joint.position_limits for joint in rig.joints)
        )

    def look(self, board: Board, time: float, active_since: float, cleared_at: float) -> None:
        """Keep what a board says now, because its next frame may say something else.

        The absence of messages is judged once in a cycle: it lasts, and no message announces it.

        Parameters
        ----------
        time : float
            When its next frame arrived, monotonic [s].
        active_since, cleared_at : float
            Since when the boards are commanded to be active, and when their faults were last
            cleared, monotonic [s].
        """
        moving = time - active_since > self._settings.board_timeout
        said = board.conditions(time, math.inf, math.inf, moving)
        self._kept.keep(condition for condition in said if condition.kind != "board_lost")
        self._kept.keep(self._range_conditions(self._sensors_of[board.name]))
        if time - cleared_at > self._settings.board_timeout:
            self._kept.keep(host_fault_of(board))

    def passing(self, found: Iterable[Condition], kind: str) -> tuple[Condition, ...]:
        """What holds now of a kind, and what held of it since the last judgement."""
        return self._kept.added_to(found, kind)

    def judged(self) -> None:
        """Forget what was wrong in passing: the driver has acted on it."""
        self._kept.judged()

    def watch_motion(
        self, readings: Readings, command_age: float, now: float, slow: bool = False
    ) -> None:
        """Take the motion and the delays of one cycle.

        Parameters
        ----------
        readings : Readings
            The measurements.
        command_age : float
            Age with which the command in use arrived [s]; 0 while none is in use.
        now : float
            Monotonic time [s].
        slow : bool, optional
            Whether the joints must keep their `reduced_velocity`.
        """
        boards = self._boards
        times = [samples[channel].time for samples, channel in boards.angles]
        self._speeds.update(*readings, times, now, slow)
        times += [samples[channel].time for samples, channel in boards.pressures]
        trips = {board.name: board.round_trip for board in boards.boards.values()}
        self.loop.update(trips, now - min(times, default=now), command_age, now)

    def judge(self, setpoints: Sequence[float] | None, readings: Readings, now: float) -> None:
        """Check the measurements of one cycle for sensor faults and against the physics.

        Parameters
        ----------
        setpoints : sequence of float or None
            The last set points that were sent to the boards, by muscle; None: to vent.
        now : float
            Monotonic time [s].
        """
        pause, self._judged_at = now - self._judged_at, now
        if longest_gap(self._settings.period) < pause < math.inf:  # infinite before the first cycle
            self._paused_at, self._pause = now, pause
        plausibility = self._plausibility
        self._air_since = math.inf if setpoints is None else min(self._air_since, now)
        if plausibility is None:
            return
        boards = self._boards
        commands, supplies = [], []
        for index, board in enumerate(boards.valves):
            if setpoints is not None and board.follows:
                commands.append(setpoints[index])
            else:
                commands.append(self._vents[index])
            supplies.append(board.supply_pressure)
        pressures = [samples[channel] for samples, channel in boards.pressures]
        unknown = (math.nan,) * len(pressures)
        new = [
            sample.value if sample.time > before else math.nan
            for sample, before in zip(pressures, self._sampled_at, strict=True)
        ]
        self._sampled_at = [sample.time for sample in pressures]
        before = plausibility.restarts
        # After a stall of this host, the physics would lag behind the measurements and report a
        # false fault: it makes up for the cycles that are missing, or restarts.
        missing = pause / plausibility.period - 1.0
        if missing * plausibility.period > LONGEST_GAP:
            if math.isfinite(missing):  # not in the first cycle
                plausibility.restart()
            missing = 0.0
        for pressures_then in [unknown] * round(missing) + [new]:
            plausibility.update(
                commands, pressures_then, readings.positions, readings.velocities, supplies
            )
        if self._restarted_at:
            self._restarted_at = [at for at in self._restarted_at if now - at <= _RESTART_MEMORY]
        if plausibility.restarts > before:
            self._restarted_at.append(now)
        found = list(plausibility.deviations())
        if self._checks is not None:
            angles = [samples[channel] for samples, channel in boards.angles]
            known = [math.nan] * len(supplies) if self._supply_may_be_empty(now) else supplies
            found += self._checks.update(pressures, angles, known, now)
        self.suspicions = tuple(
            [Condition(kind, subject, text) for kind, subject, size, text in found if size < 1.0]
        )
        self._implausible = tuple(
            [Condition(kind, subject, text) for kind, subject, size, text in found if size >= 1.0]
        )

    def _supply_may_be_empty(self, now: float) -> bool:
        """Whether the rig has a dump valve that is open, or was closed a moment ago."""
        fill_time = self._rig.people.dump_valve_fill_time
        return fill_time > 0.0 and now - self._air_since < fill_time

    def conditions(self, motion: CommandedMotion, now: float) -> Iterator[Condition]:
        """Everything that is wrong now; while air may move, each condition is a fault.

        A pause of the driver itself is no fault, but the first reason of what is wrong after it.
        """
        found = tuple(self._found(motion, now))
        if found and now - self._paused_at <= _PAUSE_MEMORY:
            text = (
                f"the driver stood still for {self._pause:.2f} s: its process was stopped, or the "
                "host is too slow; everything else that is reported follows from this, or was not "
                "noticed before"
            )
            yield Condition("driver_paused", "", text)
        yield from found

    def _found(self, motion: CommandedMotion, now: float) -> Iterator[Condition]:
        settings = self._settings
        boards = self._boards
        yield from self._bus_conditions(now)
        timeout, sensor_timeout = settings.board_timeout, settings.sensor_timeout
        moving = now - motion.since > timeout
        said: list[Condition] = []
        for board in boards.boards.values():
            said += board.conditions(now, timeout, sensor_timeout, moving)
        if not self._sensors_are_well(now):
            said += self._sensor_conditions(now)
        for condition in self._kept.added_to(said):
            if condition.kind != "latched_fault":
                yield condition
        yield from self._speeds.conditions(now)
        yield from self.loop.conditions()
        yield from self._implausible
        if len(self._restarted_at) > _RESTARTS:
            text = (
                f"{len(self._restarted_at)} pauses above {1e3 * LONGEST_GAP:.0f} ms in a second: "
                "measurements cannot be compared with the physics"
            )
            yield Condition("observers_blind", "", text)
        if motion.commanded and now - motion.command_time > settings.command_timeout:
            text = f"no valid command for {settings.command_timeout:g} s"
            if motion.last_rejection:
                text += f"; last refused: {motion.last_rejection}"
            yield Condition("command_timeout", "valve_commands", text)
        for address, sent_at in boards.sent_at.items():
            if now - max(sent_at, motion.since) > settings.command_timeout:
                text = f"nothing could be sent for {settings.command_timeout:g} s"
                yield Condition("send_blocked", boards.boards[address].name, text)

    def _bus_conditions(self, now: float) -> Iterator[Condition]:
        for name, port in self._boards.ports.items():
            state = port.state
            if state is BusState.DOWN:
                yield Condition("bus_down", name, "the CAN interface is down")
            elif state is BusState.BUS_OFF:
                text = "the CAN controller is bus-off: check wiring and bitrate"
                yield Condition("bus_off", name, text)
        yield from self.foreign(now)

    def foreign(self, now: float) -> Iterator[Condition]:
        """One condition if somebody else has commanded a board a moment ago."""
        if now - self._boards.foreign_at < _FOREIGN_MEMORY:
            yield Condition("foreign_command", "", "another driver commands boards on this bus")

    def _sensors_are_well(self, now: float) -> bool:
        """Whether `_sensor_conditions` finds nothing, by a quick look at each channel."""
        timeout, boards = self._settings.sensor_timeout, self._boards
        for (samples, channel), limit in zip(boards.pressures, self._limits, strict=True):
            sample = samples[channel]
            if now - sample.time > timeout or sample.value > limit:
                return False
        for (samples, channel), (low, high) in zip(boards.angles, self._ranges, strict=True):
            sample = samples[channel]
            if now - sample.time > timeout or not low <= sample.value <= high:
                return False
        return not any(board.availability.has_missed for board in boards.boards.values())

    def _sensor_conditions(self, now: float) -> Iterator[Condition]:
        timeout = self._settings.sensor_timeout
        rig, boards = self._rig, self._boards
        for muscle, (samples, channel) in zip(rig.muscles, boards.pressures, strict=True):
            if now - samples[channel].time > timeout:
                yield Condition("stale_sensor", muscle.name, f"no pressure for {timeout:g} s")
        for joint, (samples, channel) in zip(rig.joints, boards.angles, strict=True):
            if now - samples[channel].time > timeout:
                yield Condition("stale_sensor", joint.name, f"no angle for {timeout:g} s")
        for name, (availability, what, channel) in zip(
            self._sensor_names, boards.sensors, strict=True
        ):
            missing = availability.missing_share(what, channel, now)
            if missing * WINDOW > timeout:
                text = f"its board sent none in {100.0 * missing:.0f} % of its messages of a second"
                yield Condition("sensor_intermittent", name, f"no {what} again and again: {text}")
        yield from self._range_conditions(self._all_sensors, now - timeout)

    def _range_conditions(self, sensors: _Sensors, oldest: float = NEVER) -> Iterator[Condition]:
        """The measurements beyond their limits that are not older than this [s]."""
        rig, boards = self._rig, self._boards
        for index in sensors.pressures:
            samples, channel = boards.pressures[index]
            sample = samples[channel]
            if sample.time >= oldest and sample.value > self._limits[index]:
                muscle = rig.muscles[index]
                text = f"{sample.value:.0f} Pa, max_pressure is {muscle.max_pressure:.0f} Pa"
                yield Condition("over_pressure", muscle.name, text)
        for index in sensors.angles:
            samples, channel = boards.angles[index]
            joint, sample = rig.joints[index], samples[channel]
            lowest, highest = self._ranges[index]
            inside = lowest <= sample.value <= highest
            if not inside and sample.time >= oldest and sample.time > NEVER:
                low, high = joint.position_limits
                text = f"at {sample.value:.3f} rad, position_limits are {low:g} to {high:g} rad"
                yield Condition("position_limit", joint.name, text)
