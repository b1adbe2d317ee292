"""One cycle of the driver: measurements in, safety, set points out. No ROS, no clock of its own.

Only the I/O thread calls `cycle`; everything else may be called from another thread. The table in
`safety.states` decides whether air may move; this module finds out which events have happened.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Final

from pam_driver.board_set import BoardSet, Clock, Port
from pam_driver.boards.protocol import NEVER, Address, Board, Condition
from pam_driver.boards.wiring import RigWiring
from pam_driver.driver_settings import DriverSettings
from pam_driver.fault_judge import CommandedMotion, FaultJudge, PlausibilityCheck, Readings
from pam_driver.joint_velocity import JointVelocity
from pam_driver.safety.exhaust_watch import ExhaustWatch, exhaust_timeout
from pam_driver.safety.loop_watch import LoopWatch
from pam_driver.safety.lowering import LoweringSetpoints
from pam_driver.safety.people_inputs import PeopleInputs
from pam_driver.safety.refusals import COMMANDABLE, against_activation, against_command
from pam_driver.safety.start_up_check import StartUpCheck
from pam_driver.safety.states import OUTPUTS, SafetyEvent, SafetyState, next_state
from pam_driver.safety.stop_categories import can_lower, longest_lowering
from pam_driver.safety.valve_command_intake import NamedCommand, ValveCommandIntake
from pam_driver.snapshot import Snapshot, take_snapshot
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_model.robot import compose

_PHYSICS: Final = frozenset({"pressure_implausible", "torque_implausible"})
_BRIEFLY: Final = 0.02  # s
_VENTS: Final = frozenset({SafetyState.VENTED, SafetyState.VENTING})


class ActivationError(PamError):
    """Activation refused; the message says why and what to do."""


class Driver:
    """The driver of one rig on its buses.

    Parameters
    ----------
    rig : Rig
        Every muscle needs board and channel, every joint an encoder.
    ports : Port, or mapping of str to Port
        The open bus; by name where the rig file names several.
    settings : DriverSettings
        Limits and time-outs.
    plausibility : PlausibilityCheck, optional
        Compares measurements with physics; without it, they are only compared with limits.
    wiring : RigWiring, optional
        Wiring of this rig; by default it is made with the default options of its kinds of board.

    Attributes
    ----------
    state : SafetyState
        Decides whether air may move.
    faults : tuple of Condition
        Why the state became `FAULT`; kept until cleared.
    conditions : tuple of Condition
        What is wrong now.
    people : PeopleInputs
        Emergency stop and enabling switch.
    vent_reason : str
        Why the driver vented by itself without a fault; empty after the next activation.
    intake : ValveCommandIntake
        Checks commands and counts those that it refuses and accepts.
    broken : Condition or None
        The exception that ended the regular work of the driver's process, see `fail`.

    Raises
    ------
    PamError
        If the rig does not say where a muscle or joint is wired, or names a bus that does not
        exist.
    """

    def __init__(
        self,
        rig: Rig,
        ports: Port | Mapping[str, Port],
        settings: DriverSettings,
        plausibility: PlausibilityCheck | None = None,
        wiring: RigWiring | None = None,
    ) -> None:
        self.rig = rig
        robot = compose(rig)
        self.state = SafetyState.UNCONFIGURED
        self.faults: tuple[Condition, ...] = ()
        self.conditions: tuple[Condition, ...] = ()
        self.intake = ValveCommandIntake(rig, settings.command_timeout)
        self._settings = settings
        self._velocity = tuple(
            JointVelocity(settings.velocity_bandwidth, settings.sensor_timeout) for _ in rig.joints
        )
        named = ports if isinstance(ports, Mapping) else {"": ports}
        self._boards = BoardSet(wiring or RigWiring(rig), named, self._velocity)
        self._vents = self.intake.vented
        self.people = PeopleInputs(rig.people, self._boards.boards)
        self.vent_reason = ""
        self.broken: Condition | None = None
        self._judge = FaultJudge(robot, self._boards, settings, self._vents, plausibility)
        self._exhausts = ExhaustWatch(
            robot,
            settings.vented_pressure,
            settings.exhaust_timeout or exhaust_timeout(robot, settings.vented_pressure),
            settings.period,
        )
        self._lowering = LoweringSetpoints(robot, settings.lowering_speed)
        self._check = None
        if settings.start_up_check:
            self._check = StartUpCheck(robot, self._vents, settings.period)
        self._lock = threading.Lock()
        self._fractions: tuple[float, ...] | None = None
        self._command_time = NEVER
        self._command_age = 0.0
        self._active_since = math.inf
        self._ready_since = math.inf
        self._cleared_at = NEVER
        self._lowering_since = math.inf
        self._readings = Readings((), (), ())
        self._event(SafetyEvent.CONFIGURE, 0.0)

    @property
    def boards(self) -> Mapping[Address, Board]:
        """The boards, by the addresses that the rig file uses."""
        return self._boards.boards

    @property
    def boards_keep_fault(self) -> bool:
        """Whether every board reports that it keeps a fault of this driver."""
        return all(board.host_fault for board in self.boards.values())

    @property
    def lowers(self) -> bool:
        """Whether the driver lowers the joints at present."""
        return OUTPUTS[self.state].lower

    @property
    def loop(self) -> LoopWatch:
        """The delays of the control loop."""
        return self._judge.loop

    @property
    def suspicions(self) -> tuple[Condition, ...]:
        """Possible faults: deviations above the warning share of a plausibility limit."""
        return self._judge.suspicions

    @property
    def frame_errors(self) -> Counter[str]:
        """The number of frames that were not valid messages, by kind of error."""
        return self._boards.frame_errors

    @property
    def last_frame_error(self) -> dict[str, str]:
        """The last error of each kind."""
        return self._boards.last_frame_error

    @property
    def errors_by_bus(self) -> Mapping[str, tuple[Counter[str], dict[str, str]]]:
        """The same two for each bus, by its name."""
        return self._boards.errors_by_bus

    def set_commands(self, command: NamedCommand, now: float) -> None:
        """Use a valve command from the next cycle on.

        Raises
        ------
        CommandRefusedError
            If it is refused; the previous command stays in use until it is too old.
        """
        with self._lock:
            self.intake.hear(command.source, now)
            reason = against_command(self.state, now - command.age, self._ready_since)
            if reason:
                self.intake.refuse("not_active", reason)
            self._fractions = self.intake.take(command, now)
            self._command_time = now - command.age
            self._command_age = command.age
            self._event(SafetyEvent.COMMAND, now)

    def missing_boards(self, now: float) -> list[str]:
        """Names of boards that do not send all frames that they should."""
        timeout = self._settings.board_timeout
        return [board.name for board in self.boards.values() if board.silent(now, timeout)]

    def activation_problem(self, now: float) -> str:
        """Why activation would be refused, as one line; empty if it would succeed."""
        with self._lock:
            return self._activation_problem(now)

    def _activation_problem(self, now: float) -> str:
        return against_activation(
            self.state,
            self.faults,
            self.missing_boards(now),
            self._conditions(now),
            self._exhausts.remaining,
            self.people.not_enabled(now),
        )

    def activate(self, now: float) -> None:
        """Let air move from the next fresh command on, after the start-up check if there is one.

        Raises
        ------
        ActivationError
            If a board is missing or anything is wrong; then nothing has changed.
        """
        with self._lock:
            problem = self._activation_problem(now)
            if problem:
                raise ActivationError(problem)
            self._boards.acknowledge()
            self.intake.last_rejection = ""
            self._ready_since = now
            self.vent_reason = ""
            if self._check is not None and self.state is SafetyState.VENTED:
                self._check.start(now)
                self._event(SafetyEvent.CHECK, now)
            else:
                self._event(SafetyEvent.ACTIVATE, now)

    def deactivate(self, now: float) -> None:
        """Lower the joints and vent, without raising a fault."""
        with self._lock:
            self._stop(SafetyEvent.DEACTIVATE, now)

    def vent(self, now: float) -> None:
        """Lower the joints, then vent; called again while they are lowered, vent at once.

        The frames that begin it are sent to the boards before this returns.
        """
        with self._lock:
            self._stop(SafetyEvent.VENT, now)
            if not OUTPUTS[self.state].lower:
                self._boards.vent(now)
            self._send_valve_commands(now)

    def vent_at_once(self, now: float) -> None:
        """Vent without lowering; the frames are sent to the boards before this returns."""
        with self._lock:
            self._vent_at_once(now)
            self._boards.vent(now)
            self._send_valve_commands(now)

    def fail(self, text: str, now: float) -> None:
        """Stop after an unexpected exception, in whatever part of the process it was.

        The joints are lowered while the cycle still runs. The second exception vents at once, and
        so does one in the judgement itself: what would lower the joints is what has failed.

        Parameters
        ----------
        text : str
            Describes the exception; it becomes the text of the fault `internal_error`.
        now : float
            Monotonic time [s].
        """
        with self._lock:
            if self.broken is None:
                self.broken = Condition("internal_error", "", text)
                with contextlib.suppress(Exception):
                    self.conditions = tuple(self._conditions(now))
                    self._react(now)
                    return
            self._break_off(self.broken, now)

    def stop_stalled(self, text: str, now: float) -> bool:
        """Vent at once because the cycle does not return; called from another thread.

        Nothing happens while no air may move, or if the cycle has stalled with the driver's lock:
        then the boards' watchdogs are what vents.

        Parameters
        ----------
        text : str
            Describes it; it becomes the text of the fault `loop_too_slow`.
        now : float
            Monotonic time [s].

        Returns
        -------
        bool
            Whether the lock was free.
        """
        if not self._lock.acquire(timeout=_BRIEFLY):
            return False
        try:
            output = OUTPUTS[self.state]
            if self.state in COMMANDABLE or output.enable or output.lower:
                self._break_off(Condition("loop_too_slow", "", text), now)
        finally:
            self._lock.release()
        return True

    def _break_off(self, broken: Condition, now: float) -> None:
        """Vent at once, without any judgement."""
        if broken not in self.faults:
            self.faults += (broken,)
        self._event(SafetyEvent.FAULT, now)
        self._boards.vent(now)
        self._send_valve_commands(now)

    def clear_faults(self, now: float) -> None:
        """Clear the faults of the driver and the boards; moving still requires activation."""
        with self._lock:
            self._event(SafetyEvent.CLEAR_FAULTS, now)
            if self.state in _VENTS:
                self._exhausts.start_again()
                self._boards.clear_faults(now)
                self._cleared_at = now
                self.faults = ()
                self._boards.acknowledge()

    def close(self, now: float) -> None:
        """Vent at once and end; the port may be closed afterwards."""
        self.vent_at_once(now)
        with self._lock:
            if OUTPUTS[self.state].latch:  # a fault after which the joints were still being lowered
                self._boards.latch_fault(now)
            self._event(SafetyEvent.CLEANUP, now)

    def cycle(
        self,
        now: float,
        wall_now: float,
        clock: Clock | None = None,
        control: Callable[[Snapshot], object] | None = None,
    ) -> Snapshot:
        """Receive the frames that have arrived, judge them, and command every board.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        wall_now : float
            The same moment on the clock that stamps frames [s].
        clock : callable, optional
            Returns both times again, see `BoardSet.receive`.
        control : callable, optional
            A controller in the same process: called with the measurements of this cycle after they
            were judged, it may call `set_commands` with what is then sent.
        """
        with self._lock:
            now = self._boards.receive(now, wall_now, clock, self._look)
            snapshot = self._judge_measurements(now)
        if control is not None:
            control(snapshot)
            now = now if clock is None else clock()[0]
        with self._lock:
            sent = self._send_valve_commands(now) if OUTPUTS[self.state].send else ()
            return snapshot._replace(state=self.state, sent=sent)

    def _judge_measurements(self, now: float) -> Snapshot:
        """Judge what was received, and change the state as it demands."""
        oldest = now - self._settings.sensor_timeout
        snapshot = take_snapshot(self.state, self._boards, self._velocity, oldest)
        self._readings = Readings(snapshot.pressures, snapshot.positions, snapshot.velocities)
        # the start-up check and the lowering have limits of their own
        slow = self.state is SafetyState.ACTIVE and self.people.must_be_slow(now)
        self._judge.watch_motion(self._readings, self._command_age, now, slow)
        self._judge.judge(self._setpoints(), self._readings, now)
        output = OUTPUTS[self.state]
        self._exhausts.update(snapshot.pressures, not (output.enable or output.lower), now)
        self._hear_latched_faults(now)
        self._obey_enabling_switch(now)
        self.conditions = tuple(self._conditions(now))
        self._react(now)
        self._judge.judged()
        self.people.judged()
        if OUTPUTS[self.state].latch:
            self._boards.latch_fault(now)
        if OUTPUTS[self.state].lower:
            self._lower(now)
        return snapshot if self.state is snapshot.state else snapshot._replace(state=self.state)

    def _look(self, board: Board, time: float) -> None:
        """Keep what a board says before its next frame replaces it."""
        self._judge.look(board, time, self._active_since, self._cleared_at)
        self.people.hear_board(board)

    def _react(self, now: float) -> None:
        """Change the state as what was found demands."""
        found, state = self.conditions, self.state
        if state is SafetyState.CHECKING and self._check is not None:
            self._go_on_checking(self._check, now)
        elif state in COMMANDABLE:
            if found:
                self.faults = found
                self._stop(SafetyEvent.FAULT_LOWER if can_lower(found) else SafetyEvent.FAULT, now)
        elif OUTPUTS[state].lower:
            new = tuple(one for one in found if all(one[:2] != old[:2] for old in self.faults))
            if new:
                self.faults += new
                lower = can_lower(self.faults)
                self._event(SafetyEvent.FAULT_LOWER if lower else SafetyEvent.FAULT, now)
            elif self._lowered(now):
                self._event(SafetyEvent.LOWERED, now)
        else:
            blocked = [one for one in found if one.kind == "exhaust_blocked"]
            if blocked:
                known = {fault[:2] for fault in self.faults}
                self.faults += tuple(one for one in blocked if one[:2] not in known)
                self._event(SafetyEvent.EXHAUST_BLOCKED, now)
            empty = self._exhausts.empty
            self._event(SafetyEvent.EMPTY if empty else SafetyEvent.NOT_EMPTY, now)

    def _go_on_checking(self, check: StartUpCheck, now: float) -> None:
        """One cycle of the start-up check.

        It names its findings more exactly than the comparison with physics, which is left out.
        """
        found = tuple(one for one in self.conditions if one.kind not in _PHYSICS)
        if not found:
            self._fractions = check.setpoints(
                self._readings.pressures, self._readings.positions, now
            )
            found = check.findings if check.finished else ()
        if found:
            self.faults = found
            self._event(SafetyEvent.FAULT, now)
        elif check.finished:
            self._ready_since = now  # a command from before the end of the check is old
            self._event(SafetyEvent.CHECKED, now)

    def _stop(self, event: SafetyEvent, now: float) -> None:
        """Stop; where there is nothing to lower, the valves vent at once."""
        self._event(event, now)
        if OUTPUTS[self.state].lower and self._lowered(now):
            self._event(SafetyEvent.LOWERED, now)

    def _vent_at_once(self, now: float) -> None:
        """Vent without lowering; the second of two vents ends a lowering."""
        self._event(SafetyEvent.VENT, now)
        if OUTPUTS[self.state].lower:
            self._event(SafetyEvent.VENT, now)

    def _lowered(self, now: float) -> bool:
        """Whether all muscles are empty, or the time for lowering is over."""
        longest = min(self._settings.lowering_timeout, longest_lowering(self.faults))
        return now - self._lowering_since >= longest or self._exhausts.below

    def _event(self, event: SafetyEvent, now: float) -> None:
        """Change the state as the table says; the command is discarded when `ACTIVE` ends."""
        before = self.state
        self.state = next_state(before, event)
        if self.state is before:
            return
        output = OUTPUTS[self.state]
        if self.state is SafetyState.ACTIVE:
            self._active_since = now
        elif output.lower and not OUTPUTS[before].lower:
            self._lowering_since = now
            self._lowering.start(self._fractions or self._vents, now)
            self._lower(now)
        elif not output.lower:
            self._fractions = None
            self._command_age = 0.0
            self._active_since = math.inf
        if output.vent_on_entry and before is not SafetyState.UNCONFIGURED:
            self._boards.vent(now)

    def _hear_latched_faults(self, now: float) -> None:
        """A pressed emergency stop, and a fault that a board keeps from an earlier run."""
        held = self.people.pressed(now)
        # a board that was just asked to clear its faults needs a moment to report it
        if not held and now - self._cleared_at > self._settings.board_timeout:
            held = self._judge.passing(self._boards.host_faults(), "latched_fault")
        if held:
            before = self.state
            self._event(SafetyEvent.LATCHED_FAULT, now)
            if self.state is not before:
                # a fault that the boards keep may be that of another driver on this bus
                self.faults = (*held, *self._judge.foreign(now))

    def _lower(self, now: float) -> None:
        """The next set points that lower the joints."""
        self._fractions = self._lowering.setpoints(*self._readings, now)

    def _obey_enabling_switch(self, now: float) -> None:
        """Vent at once while the enabling switch is not held; that is no fault.

        Its board does so by itself, so the joint could not be lowered in any case.
        """
        output = OUTPUTS[self.state]
        if self.state is SafetyState.READY or output.enable or output.lower:
            reason = self.people.not_enabled(now)
            if reason:
                self.vent_reason = reason
                self._vent_at_once(now)

    def _setpoints(self) -> tuple[float, ...] | None:
        """The set points of the valves; None while they vent."""
        output = OUTPUTS[self.state]
        return self._fractions if output.enable or output.lower else None

    def _conditions(self, now: float) -> Iterator[Condition]:
        motion = CommandedMotion(
            self.state is SafetyState.ACTIVE,
            self._active_since,
            self._command_time,
            self.intake.last_rejection,
        )
        if self.broken is not None:
            yield self.broken
        yield from self._judge.conditions(motion, now)
        yield from self.intake.conditions(now)
        yield from self._exhausts.conditions(now)
        yield from self.people.conditions(now)

    def _send_valve_commands(self, now: float) -> tuple[float, ...]:
        """Command every board; returns what was sent, empty if one board could not be reached."""
        setpoints = self._setpoints()
        if not self._boards.command(setpoints, now):
            return ()
        return self._vents if setpoints is None else setpoints
