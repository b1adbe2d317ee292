"""A small test pulse on each valve before the arm may move, watched by all sensors.

One muscle after another gets a little air while all others vent. The readings of the sensors then
distinguish crossed hoses, dead valves, wrong sensors and blocked exhausts:

- its own pressure rises, and no other: valve, hose and sensor belong together;
- another pressure rises instead: hoses or sensors are exchanged. If the joint turns towards the
  muscle whose valve was opened, the air is in the right muscle and the sensors are exchanged;
- its own pressure rises and the joint turns the other way: the hoses are crossed behind the sensor;
- no pressure rises, but the joint turns: the sensor is dead;
- nothing happens: the valve does not open, the hose is off or closed, or the sensor is dead;
- the pressure does not fall again: the exhaust is blocked or the valve is stuck open.

The pulse is as large as possible without moving the joint much, held back by gravity and inertia
(`pam_model.views.harmless_pressure`), within `SMALLEST` and `LARGEST`. A joint that turns by more
than `ABORT_ANGLE` ends the check.

A joint that turns further than that at `SMALLEST` is free, as a horizontal one is. Its pulse ends
as soon as it has turned by `ALLOWED_ANGLE` and a sensor shows `LEAST_SEEN`; coasting on is no
finding.

A pulse is judged only if the computer watched it from its begin to its end. If the time between
two cycles was longer than `pauses.longest_gap`, nobody looked while the valve was open: the muscle
is vented and gets its pulse again, `REPETITIONS` times. After that the check ends and says that the
computer stood still; it accuses nothing on the robot.

A flow valve is opened by a ramp, so slow that a muscle reaches the pressure in `RISE`, or later if
the supply sags; a valve with an overlap of `OVERLAP` starts later and is found healthy. A pressure
regulator is given the pressure as set point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from pam_driver.boards.protocol import Condition
from pam_driver.safety.exhaust_watch import exhaust_timeout
from pam_driver.safety.pauses import longest_gap
from pam_model.robot import Robot, RobotMuscle
from pam_model.views.harmless_pressure import harmless_pressure
from pam_model.views.pressure_rate import filling_rate
from pam_model.views.time_to_empty import emptying_time_constant
from pam_model.views.time_to_fill import delay_of_supply

ALLOWED_ANGLE: Final = 0.03
"""The joint should turn by no more than this during a pulse [rad]."""
ABORT_ANGLE: Final = 0.15
"""A joint that turns by more ends the check [rad]."""
SMALLEST, LARGEST = 8e3, 5e4
"""Bounds of a pulse's pressure [Pa]; the smaller is some thirty steps of a 12 bit sensor."""
LEAST_SEEN: Final = 2e3
"""A pulse that a free joint cuts short must have reached this [Pa]: eight steps of the sensor."""
RISE: Final = 0.25
"""Time in which a healthy flow valve without overlap reaches the pressure of its pulse [s]."""
OVERLAP: Final = 0.15
"""Largest overlap of a flow valve that is accepted, as a share of full opening."""
SLOWER: Final = 3.0
"""A valve, a hose or an exhaust may be so many times slower than the rig file says."""
NOT_EMPTY: Final = 2e4
"""A muscle that keeps this pressure while it vents cannot be tested [Pa]; less may be an offset."""
SEEN_TURN: Final = 0.01
"""A joint that turns by more has certainly turned [rad]."""
REPETITIONS: Final = 5
"""A muscle whose pulse was interrupted by a pause of the computer is tested so many times more."""
_SHARE: Final = 0.5  # another pressure that rises by this share of the pulse is not the noise
_EMPTY: Final = 0.5  # share of a pulse below which a muscle counts as empty
_REGULATION: Final = 10.0  # time constants until a pressure regulator has reached its set point
_SETTLE: Final = 0.3  # s, added to every wait, for delays of bus and valve
_STILL: Final = 0.25  # s, without motion before the next pulse
_STILL_TURN: Final = 0.002  # rad in that time
_STILL_SHARE: Final = 0.2  # of a pulse in that time, for the pressures
_LEAST_SETTLING: Final = 10.0  # s, that the settling may take; more for large muscles


@dataclass(frozen=True, slots=True)
class Pulse:
    """The test pulse of one muscle."""

    pressure: float  # pressure at which it ends [Pa gauge]
    ramp: float  # how fast a flow valve is opened [1/s]; 0 for a pressure regulator
    # rise, fall: time limits for filling and emptying [s]
    rise: float
    fall: float
    free: bool  # whether neither gravity nor inertia holds the joint back


class _Phase(Enum):
    SETTLE = "all muscles become empty, and the joints come to rest"
    FILL = "a muscle is filled"
    EMPTY = "it is emptied"
    DONE = "every muscle has been tested, or the check has ended"


class StartUpCheck:
    """The check of one rig.

    Parameters
    ----------
    robot : Robot
        Gives muscles, valves and joints.
    vents : sequence of float
        By muscle the fraction of full scale at which its valve vents.
    period : float, optional
        Time between two cycles [s].

    Attributes
    ----------
    pulses : tuple of Pulse
        By muscle.
    findings : tuple of Condition
        What was found, one line each; empty if everything is healthy so far.
    turned_right : dict of str to bool
        By muscle whose own pressure rose while a joint turned: whether it turned the right way.
    """

    def __init__(self, robot: Robot, vents: Sequence[float], period: float = 0.002) -> None:
        self.pulses = tuple(pulse_of(robot, muscle) for muscle in robot.muscles)
        self._robot = robot
        self._vents = tuple(vents)
        self._longest_gap = longest_gap(period)
        # a valve that was left open during a pause may have filled its muscle completely
        self._longest_settling = max(_LEAST_SETTLING, exhaust_timeout(robot, NOT_EMPTY))
        self.start(0.0)

    @property
    def finished(self) -> bool:
        """Whether nothing more is to be tested."""
        return self._phase is _Phase.DONE

    def start(self, now: float) -> None:
        """Begin with the first muscle."""
        self.findings: tuple[Condition, ...] = ()
        self.turned_right: dict[str, bool] = {}
        self._muscle = self._pauses = 0
        self._cycle_at = now
        self._still_pressures: tuple[float, ...] = ()
        self._begin_settling(now)

    def _begin_settling(self, now: float) -> None:
        self._phase = _Phase.SETTLE
        self._since = self._still_since = now
        self._still_positions: tuple[float, ...] = ()

    def setpoints(
        self, pressures: Sequence[float], positions: Sequence[float], now: float
    ) -> tuple[float, ...]:
        """The fractions of full scale for one cycle.

        Parameters
        ----------
        pressures : sequence of float
            By muscle [Pa gauge].
        positions : sequence of float
            By joint [rad].
        now : float
            Monotonic time [s].
        """
        pause, self._cycle_at = now - self._cycle_at, now
        if pause > self._longest_gap and not self.finished:
            self._begin_again(now)
        if self._phase is _Phase.SETTLE:
            self._settle(pressures, positions, now)
        elif self._phase is not _Phase.DONE:
            self._watch(pressures, positions, now)
        fractions = list(self._vents)
        if self._phase is _Phase.FILL:
            fractions[self._muscle] = self._fraction(now)
        return tuple(fractions)

    def _fraction(self, now: float) -> float:
        muscle, pulse = self._robot.muscles[self._muscle], self.pulses[self._muscle]
        if pulse.ramp:
            return min(1.0, pulse.ramp * (now - self._since))
        return pulse.pressure / (muscle.valve.full_scale or math.inf)

    def _begin_again(self, now: float) -> None:
        """Test the present muscle once more, because a pause has interrupted its test."""
        self._pauses += 1
        if self._pauses <= REPETITIONS:
            self._begin_settling(now)
            return
        text = (
            f"the computer stood still for more than {1e3 * self._longest_gap:.0f} ms "
            f"{self._pauses} times while {self._robot.muscle_names[self._muscle]} was tested: it "
            "is too busy, and the start-up check has not been finished"
        )
        self.findings = (*self.findings, Condition("driver_paused", "", text))
        self._phase = _Phase.DONE

    def _settle(self, pressures: Sequence[float], positions: Sequence[float], now: float) -> None:
        """Wait for empty muscles and joints at rest, then begin the next pulse."""
        change = _STILL_SHARE * self.pulses[self._muscle].pressure
        turned = _largest_change(positions, self._still_positions)
        if turned > _STILL_TURN or _largest_change(pressures, self._still_pressures) > change:
            self._still_positions, self._still_pressures = tuple(positions), tuple(pressures)
            self._still_since = now
        full = [index for index, value in enumerate(pressures) if not value < NOT_EMPTY]
        if not full and now - self._still_since >= _STILL:
            self._phase, self._since = _Phase.FILL, now
            self._rest, self._start = tuple(pressures), tuple(positions)
            self._highest = list(pressures)
            self._turn = self._sign = 0.0
        elif now - self._since > self._longest_settling:
            for index in full:
                self._find(
                    index,
                    f"shows {pressures[index]:.0f} Pa while it vents: its {_valve(self, index)} is "
                    f"stuck open, its exhaust is blocked, or its {_sensor(self, index)} is wrong",
                )
            if not full:
                name = self._robot.joints[0].name if len(self._robot.joints) == 1 else "a joint"
                self._find(self._muscle, f"not tested: {name} does not come to rest")
            self._phase = _Phase.DONE

    def _watch(self, pressures: Sequence[float], positions: Sequence[float], now: float) -> None:
        pulse = self.pulses[self._muscle]
        self._highest = [max(pair) for pair in zip(self._highest, pressures, strict=True)]
        moves = [here - there for here, there in zip(positions, self._start, strict=True)]
        for arm in self._robot.muscles[self._muscle].arms:
            if abs(moves[arm.joint]) > abs(self._turn):
                self._turn, self._sign = moves[arm.joint], math.copysign(1.0, arm.length)
        risen = [high - rest for high, rest in zip(self._highest, self._rest, strict=True)]
        turned = max((abs(move) for move in moves), default=0.0)
        cut_short = pulse.free and turned > ALLOWED_ANGLE and max(risen) >= LEAST_SEEN
        if turned > ABORT_ANGLE and not cut_short:
            self._conclude(risen, aborted=True)
            self._phase = _Phase.DONE
        elif self._phase is _Phase.FILL:
            if max(risen) >= pulse.pressure or now - self._since > pulse.rise or cut_short:
                self._phase, self._since = _Phase.EMPTY, now
        elif (
            now - self._since >= _SETTLE
            and max(here - rest for here, rest in zip(pressures, self._rest, strict=True))
            < _EMPTY * pulse.pressure
        ):
            self._conclude(risen)
            self._next(now)
        elif now - self._since > pulse.fall:
            before = len(self.findings)
            self._conclude(risen)
            if len(self.findings) == before:
                self._find(
                    self._muscle,
                    f"its {_sensor(self, self._muscle)} still shows "
                    f"{pressures[self._muscle]:.0f} Pa {pulse.fall:.2g} s after the pulse: its "
                    f"exhaust is blocked or its {_valve(self, self._muscle)} is stuck open",
                )
            self._phase = _Phase.DONE  # no more air into a rig that cannot be emptied

    def _next(self, now: float) -> None:
        self._muscle += 1
        self._pauses = 0
        self._begin_settling(now)
        if self._muscle == len(self.pulses):
            self._phase = _Phase.DONE

    def _conclude(self, risen: Sequence[float], *, aborted: bool = False) -> None:
        """What the pulse of the present muscle has shown."""
        muscle, pulse = self._muscle, self.pulses[self._muscle]
        names, turn = self._robot.muscle_names, self._turn
        enough = _SHARE * pulse.pressure
        if pulse.free:  # the joint may have cut the pulse short
            enough = min(enough, max(_SHARE * max(risen), LEAST_SEEN))
        others = [place for place, rise in enumerate(risen) if place != muscle and rise >= enough]
        right = self._sign * turn > SEEN_TURN
        wrong = self._sign * turn < -SEEN_TURN
        valve, sensor = _valve(self, muscle), _sensor(self, muscle)
        own = risen[muscle] >= enough
        if own and (right or wrong):
            self.turned_right[names[muscle]] = right
        if others and not own:
            other = names[others[0]]
            both = f"the {sensor} and the {_sensor(self, others[0])} ({other})"
            reason = (
                f"{both} are exchanged" if right else f"hoses, valves or sensors: {other} fills"
            )
            if wrong:
                reason = f"its hose and that of {other} are crossed"
            self._find(muscle, f"its {valve} raises the pressure of {other}: {reason}")
        elif others:
            shown = ", ".join(names[place] for place in others)
            self._find(muscle, f"its {valve} also raises the pressure of {shown}: hoses are joined")
        elif own and wrong:
            self._find(
                muscle,
                f"its {valve} turns the joint by {turn:+.2f} rad, the wrong way: hoses are crossed "
                f"behind the {sensor}, or the encoder counts the other way",
            )
        elif own and aborted:
            self._find(
                muscle,
                f"a pulse of {risen[muscle]:.0f} Pa turns the joint by {turn:+.2f} rad, allowed "
                f"are {ABORT_ANGLE:g} rad: load or {sensor} differ from the rig file",
            )
        elif not own and (right or wrong or aborted):
            self._find(
                muscle,
                f"its {valve} turns the joint by {turn:+.2f} rad, but its {sensor} shows no "
                "pressure: the sensor is dead",
            )
        elif not own:
            self._find(
                muscle,
                f"its {sensor} shows no pressure after a pulse: its {valve} is stuck shut, its "
                "hose is off or closed, or the sensor is dead",
            )

    def _find(self, muscle: int, text: str) -> None:
        found = Condition("start_up_check", self._robot.muscle_names[muscle], text)
        self.findings = (*self.findings, found)


def pulse_of(robot: Robot, muscle: RobotMuscle) -> Pulse:
    """The test pulse of a muscle, from the physics of the robot.

    Parameters
    ----------
    robot : Robot
        Gives joint, force model, volume and supply.
    """
    harmless = min(
        (harmless_pressure(robot, arm, ALLOWED_ANGLE, RISE, LARGEST) for arm in muscle.arms),
        default=SMALLEST,
    )
    free = harmless * ABORT_ANGLE < SMALLEST * ALLOWED_ANGLE
    pressure = min(max(harmless, SMALLEST), LARGEST, 0.5 * muscle.max_pressure)
    # Near ambient pressure the flow falls with the pressure, which decays like e^(-t/T). The limit
    # allows an overshoot of the same size.
    constant = emptying_time_constant(robot, muscle, pressure)
    lag = muscle.valve.time_constant
    fall = SLOWER * 4.0 * constant + 2.0 * lag + 3.0 * _SETTLE
    if muscle.valve.kind != "flow":
        wait = _REGULATION * lag * SLOWER + _SETTLE
        return Pulse(pressure, 0.0, wait, wait + fall, free)
    ramp = 2.0 * pressure / (filling_rate(robot, muscle) * RISE * RISE)
    rise = OVERLAP / ramp + SLOWER * (RISE + delay_of_supply(robot, muscle, pressure)) + _SETTLE
    return Pulse(pressure, ramp, rise, fall, free)


def _largest_change(here: Sequence[float], there: Sequence[float]) -> float:
    """The largest difference; infinite if there is nothing to compare with."""
    if len(here) != len(there):
        return math.inf
    return max((abs(a - b) for a, b in zip(here, there, strict=True)), default=0.0)


def _valve(check: StartUpCheck, muscle: int) -> str:
    """The valve of a muscle, as text."""
    one = check._robot.rig.muscles[muscle]
    return f"valve (board {one.board}, channel {one.channel})"


def _sensor(check: StartUpCheck, muscle: int) -> str:
    """The pressure sensor of a muscle, as text; it is on the valve's channel by default."""
    one = check._robot.rig.muscles[muscle]
    place = one if one.pressure_sensor is None else one.pressure_sensor
    return f"pressure sensor (board {place.board}, channel {place.channel})"
