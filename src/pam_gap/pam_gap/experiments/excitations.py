"""The menu of safe excitations from which the next experiment is chosen.

Every excitation can be played on any antagonistic joint with its controller and without new
hardware. It consists of a position reference and a co-contraction (mean of both pressures) over
time. Some end with valve commands that replace the pressure loop, and some need the joint mounted
upside down or locked. All stay within the position limits and within 80 % of the pressure that the
rig allows, start at rest at position 0, and move no faster than the smooth steps defined here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pam_gap.recordings.recording import LOCKED, TURNED_OVER
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.gravity import gravity_torque

Array = npt.NDArray[np.float64]

POSITION_GAIN = 0.1  # of the highest pressure, per rad of position error
LOOP_RATE = 6.0  # 1/s, of the pressure loop at the supply's flow
SETTLE = 2.0  # s at rest before anything moves
GRID = 0.05  # s, on which static pressures are solved
HIGHEST = 0.79  # of the highest pressure: upper limit of a reference
LOWEST = 0.03  # of the highest pressure: lower limit of a reference


@dataclass(frozen=True, slots=True)
class Excitation:
    """One entry of the menu, sampled for one rig."""

    name: str  # identifier
    instruction: str  # instruction for people
    time: Array  # shape (n,): time from 0 [s]
    position: Array  # shape (n,): reference [rad]
    # level, difference: shape (n,): mean and half the difference of the pressure references [Pa
    # gauge], agonist first
    level: Array
    difference: Array
    # gain from the position error to `difference` [Pa/rad]; 0 without feedback of the position
    position_gain: float
    # time from which `open_commands` replace the pressure loop [s]; infinite for never
    open_from: float = math.inf
    # commands of the agonist's and the antagonist's valve
    open_commands: tuple[float, float] = (0.0, 0.0)
    mounting: str = ""  # empty, `recording.TURNED_OVER` or `recording.LOCKED`

    @property
    def sample_time(self) -> float:
        """Step of the grid [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.time[-1])


def smooth_path(time: Array, knots: Sequence[tuple[float, float]], move: float) -> Array:
    """A path of constant levels that are connected by quintic polynomials.

    Parameters
    ----------
    time : ndarray
        [s].
    knots : sequence of (float, float)
        Time at which a move begins [s] and level at which it ends; the first is the start.
    move : float
        Duration of a move [s].
    """
    result = np.full(time.shape, knots[0][1])
    for (_, before), (start, value) in pairwise(knots):
        s = np.clip((time - start) / move, 0.0, 1.0)
        result = result + (value - before) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return result


def stairs(values: Sequence[float], dwell: float) -> list[tuple[float, float]]:
    """Knots for values that are held for `dwell` seconds each, after the settling time."""
    return [(0.0, values[0])] + [(SETTLE + i * dwell, value) for i, value in enumerate(values[1:])]


def _chirp(time: Array, low: float, high: float) -> Array:
    gone = np.clip(time - SETTLE, 0.0, None)
    length = float(gone[-1])
    growth = math.log(high / low) / length
    fade = np.clip(np.minimum(gone, length - gone) / 1.0, 0.0, 1.0)
    wave: Array = fade * np.sin(2.0 * math.pi * low * (np.exp(growth * gone) - 1.0) / growth)
    return wave


class Menu:
    """Excitations sampled for one joint of a rig.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    joint : int
        Number of the joint.
    sample_time : float
        Sample time of the excitations [s].
    """

    def __init__(self, rig: Rig, joint: int, sample_time: float) -> None:
        self.rig = rig
        robot = compose(rig)
        self.entry = robot.joints[joint]
        self.statics = JointStatics.from_robot(robot, self.entry)
        self.sample_time = sample_time
        self.highest = min(muscle.high_pressure for muscle in self.statics.muscles)
        low, high = self.entry.position_limits
        inside = self.statics.position_range
        self.reach = 0.8 * min(-low, -inside[0], high, inside[1])
        self.has_flow_valves = all(
            robot.muscles[place].valve.kind == "flow" for place in self.entry.muscles
        )

    def _time(self, duration: float) -> Array:
        time: Array = np.arange(round(duration / self.sample_time), dtype=np.float64)
        time *= self.sample_time
        return time

    def static_difference(self, position: Array, level: Array, time: Array, turn: float) -> Array:
        """Half the pressure difference that holds each position against gravity [Pa]."""
        every = max(1, round(GRID / self.sample_time))
        at = np.unique(np.append(np.arange(0, time.size, every), time.size - 1))
        solved = np.empty(at.size)
        probe = 0.05 * self.highest
        for i, k in enumerate(at.tolist()):
            q, p = float(position[k]), float(level[k])
            gravity = -gravity_torque(self.entry, q - turn)
            above = self.statics.torque((p + probe, p - probe), q)
            below = self.statics.torque((p - probe, p + probe), q)
            slope = (above - below) / (2.0 * probe)
            solved[i] = (gravity - 0.5 * (above + below)) / slope if slope > 0.0 else 0.0
        room = np.minimum(
            level[at] - LOWEST * self.highest, HIGHEST * self.highest - level[at]
        ).clip(0.0)
        result: Array = np.interp(time, time[at], np.clip(solved, -room, room))
        return result

    def _moved(
        self,
        name: str,
        instruction: str,
        time: Array,
        position: Array,
        level: Array,
        *,
        mounting: str = "",
        open_from: float = math.inf,
        open_commands: tuple[float, float] = (0.0, 0.0),
    ) -> Excitation:
        turn = math.pi if mounting == TURNED_OVER else 0.0
        pressure = level * self.highest
        return Excitation(
            name,
            instruction,
            time,
            position,
            pressure,
            self.static_difference(position, pressure, time, turn),
            POSITION_GAIN * self.highest,
            open_from,
            open_commands,
            mounting,
        )

    def entries(self) -> tuple[Excitation, ...]:
        """The menu without the excitations that the rig's valves cannot do."""
        a = self.reach
        still = self._time(20.0)
        slow = self._time(24.0)
        flat = np.zeros(still.size)
        middle = np.full(still.size, 0.4)
        hold_position = smooth_path(
            slow, stairs([0.0, a, -a, 0.4 * a, -0.4 * a, a, -a, 0.0], 3.0), 0.8
        )
        hold_level = smooth_path(
            slow, stairs([0.4, 0.25, 0.25, 0.4, 0.4, 0.55, 0.55, 0.4], 3.0), 0.8
        )
        cycles = a * np.sin(2.0 * math.pi * np.clip(slow - SETTLE, 0.0, None) / 5.5)
        two_levels = smooth_path(slow, [(0.0, 0.25), (12.5, 0.5)], 1.0)
        sweep = smooth_path(slow, stairs([0.4, 0.12, 0.55, 0.12, 0.55, 0.3], 4.0), 3.5)
        tiny = smooth_path(
            slow,
            stairs([0.0, *(0.06 * a * x for x in (1, 2, 1, 0, -1, 0, 1, 0, -2, -1, 0, 2, 0))], 1.6),
            0.15,
        )
        quick = smooth_path(
            slow, stairs([0.4, 0.15, 0.6, 0.15, 0.6, 0.25, 0.5, 0.15, 0.6], 2.4), 0.15
        )
        menu = [
            self._moved(
                "holds", "hold three angles on either side at three co-contractions",
                slow, hold_position, hold_level),
            self._moved(
                "microsteps", "make small steps around 0, the valves near their null",
                slow, tiny, np.full(slow.size, 0.35)),
            self._moved(
                "co_contraction_sweep", "hold one angle and sweep the co-contraction slowly",
                slow, smooth_path(slow, [(0.0, 0.0), (SETTLE, 0.5 * a)], 1.0), sweep),
            self._moved(
                "co_contraction_steps", "hold one angle and fill and empty both muscles quickly",
                slow, smooth_path(slow, [(0.0, 0.0), (SETTLE, 0.4 * a)], 1.0), quick),
            self._moved(
                "slow_cycles", "swing slowly to and fro at a low and a high co-contraction",
                slow, cycles, two_levels),
            self._moved(
                "chirp", "follow a sine from 0.2 to 3 Hz",
                still, 0.5 * a * _chirp(still, 0.2, 3.0), middle),
            self._moved(
                "turned_over",
                "mount the joint turned over, so that gravity pulls the other way, and hold three "
                "angles on either side at three co-contractions",
                slow, hold_position, np.maximum(hold_level, 0.35), mounting=TURNED_OVER),
        ]  # fmt: skip
        if self.has_flow_valves:
            raised = smooth_path(still, [(0.0, 0.0), (SETTLE, a)], 1.0)
            menu += [
                self._moved(
                    "leak_down", "hold an angle, then shut both valves and wait",
                    still, smooth_path(still, [(0.0, 0.0), (SETTLE, 0.6 * a)], 1.0), middle,
                    open_from=5.0),
                self._moved(
                    "vented_swing", "raise the joint, vent both muscles and let it swing",
                    still, raised, np.full(still.size, 0.3),
                    open_from=5.0, open_commands=(-1.0, -1.0)),
            ]  # fmt: skip
        drive = smooth_path(still, stairs([0.0, 1.0, -1.0, 0.5, -0.5, 0.0], 1.8), 0.2)
        drive = np.where(still < 11.0, drive, _chirp(still - 9.0, 0.3, 5.0))
        menu.append(
            Excitation(
                "locked_joint",
                "lock the joint at 0 and step and sweep the pressures against each other",
                still, flat, 0.35 * self.highest * np.ones(still.size),
                0.2 * self.highest * drive, 0.0, mounting=LOCKED,
            )
        )  # fmt: skip
        return tuple(menu)
