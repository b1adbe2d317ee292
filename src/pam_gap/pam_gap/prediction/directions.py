"""Whether commands raise pressures, and pressures turn the joint, in the expected direction.

Below its natural frequency, a joint between two muscles moves like a spring: it follows the torque
of the measured pressures with little lag. The phase between the two is then near 0 degrees,
whatever inertia, stiffness, pulley and valves are, and near 180 degrees if a sign is reversed or
two hoses are exchanged. Pressures follow the commands in the same way. This needs no simulation.

The phase and the coherence are those of the mean cross spectrum over a band of low frequencies, of
windowed signals without their trends (Bendat and Piersol, Random Data, chapter 5). scipy.signal
removes a trend as well, but its import takes a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import zip_longest

import numpy as np

from pam_gap.prediction.channel_order import AGONIST_PRESSURE, BOTH_PRESSURES, POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, SHUT, TURNED_OVER
from pam_gap.rules.recording_rules import RecordingRules
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.robot import compose
from pam_model.views.gravity import gravity_stiffness, gravity_torque
from pam_model.views.torque_balance import inertia_torque


class Direction(Enum):
    """Whether a signal follows another, goes against it, or neither is certain."""

    AGREES = "agrees"
    OPPOSED = "opposed"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class CrossPhase:
    """How one signal follows another at low frequencies."""

    phase: float = math.nan  # absolute phase of the mean cross spectrum [deg], 0 to 180
    # squared magnitude of the mean cross spectrum over both mean powers, 0 to 1
    coherence: float = 0.0
    # lowest, highest: band of frequencies [Hz]
    lowest: float = math.nan
    highest: float = math.nan
    # UNDECIDED where the signals are not coherent enough
    direction: Direction = Direction.UNDECIDED

    def words(self, first: str, second: str) -> str:
        """The evidence, as the end of a sentence."""
        return (
            f"{first} and {second} have a phase of {self.phase:.0f} degrees from "
            f"{self.lowest:.2g} to {self.highest:.2g} Hz, with a coherence of {self.coherence:.2f}"
        )


@dataclass(frozen=True, slots=True)
class Directions:
    """Whether the pressures follow the commands, and the joint the pressures."""

    # of the difference of the commands and the torque of the pressures (its rate, for flow valves,
    # which admit air as long as they are open)
    drive: CrossPhase = CrossPhase()
    motion: CrossPhase = CrossPhase()  # of the torque of the pressures and the position


def without_trend(signal: Array) -> Array:
    """Equally spaced samples without the straight line that fits them best, shape (n,)."""
    place = np.arange(signal.size) - 0.5 * (signal.size - 1)
    slope = (place @ signal) / (place @ place)
    result: Array = signal - signal.mean() - slope * place
    return result


def cross_phase(
    pairs: list[tuple[Array, Array, float]],
    highest: float,
    rules: RecordingRules,
    causes: Sequence[Array] = (),
) -> CrossPhase:
    """Phase and coherence of pairs of signals below a frequency.

    Parameters
    ----------
    pairs : list of (ndarray of shape (N,), ndarray of shape (N,), float)
        Both signals and the sample time [s] of every recording.
    highest : float
        Upper end of the band [Hz].
    rules : RecordingRules
        The least coherence, and the phases that decide.
    causes : sequence of ndarray of shape (N,), optional
        A third signal of each recording. What both signals owe to it, with any lag, does not count
        (partial cross spectrum; Bendat and Piersol, chapter 7).
    """
    cross, first, second = 0.0 + 0.0j, 0.0, 0.0
    lowest, bins = math.inf, 0
    for (x, y, step), cause in zip_longest(pairs, causes):
        if x.size < 16 or not (np.ptp(x) > 0.0 and np.ptp(y) > 0.0):
            continue
        window = np.hanning(x.size)
        a, b = (np.fft.rfft(window * without_trend(z)) for z in (x, y))
        frequency = np.fft.rfftfreq(x.size, step)
        band = (frequency > 1.5 * frequency[1]) & (frequency <= highest)
        if not band.any():
            continue
        a, b = a[band], b[band]
        if cause is not None and np.ptp(cause) > 0.0:
            third = np.fft.rfft(window * without_trend(cause))[band]
            power = np.vdot(third, third)
            a, b = (z - np.vdot(third, z) / power * third for z in (a, b))
        scale = float(step)  # so that recordings of other sample times count by their energy
        cross += scale * complex(np.vdot(a, b))
        first += scale * float(np.vdot(a, a).real)
        second += scale * float(np.vdot(b, b).real)
        lowest, bins = min(lowest, float(frequency[band][0])), bins + int(band.sum())
    if bins < rules.direction_lines or not (first > 0.0 and second > 0.0):
        return CrossPhase()
    phase = abs(math.degrees(float(np.angle(cross))))
    coherence = abs(cross) ** 2 / (first * second)
    direction = Direction.UNDECIDED
    if coherence >= rules.direction_coherence:
        if phase <= rules.direction_phase:
            direction = Direction.AGREES
        elif phase >= 180.0 - rules.direction_phase:
            direction = Direction.OPPOSED
    return CrossPhase(phase, coherence, lowest, highest, direction)


def directions(problem: PredictionProblem) -> Directions:
    """In which direction pressures follow the commands, and the joint the pressures.

    The motion is not decided where the joint is locked, its valves are shut, or a torque from
    outside moves it; and where gravity may be stronger than the muscles, so that the joint must be
    held back as it falls, it is decided only if the gravity of the rig file changes nothing.
    """
    rules = problem.rules.recording
    rig, entry = problem.rig, problem.rig.joints[problem.joint]
    free = [d for d in problem.data if d.recording.mounting not in (SHUT, LOCKED)]
    free = [d for d in free if d.external is None]
    if not free:
        return Directions()
    try:
        joint = JointStatics.from_rig(rig, entry.name)
        usual = [float(np.median(d.measured[:, BOTH_PRESSURES])) for d in free]
        pressure = max(float(np.median(usual)), 1e3)
        per_pressure = np.array(
            [joint.torque((pressure, 0.0), 0.0), joint.torque((0.0, pressure), 0.0)]
        )
        stiffness = joint.stiffness((pressure, pressure), 0.0)
    except PamError:  # a pressure or length outside the model of the muscle
        return Directions()
    per_pressure = per_pressure / pressure
    body = compose(rig).joints[problem.joint]
    stiffness += max(gravity_stiffness(body, 0.0), 0.0)
    if not stiffness > 0.0:
        return Directions()
    natural = math.sqrt(stiffness / inertia_torque(body, 1.0)) / (2.0 * math.pi)
    highest = rules.direction_band * natural

    def torque(data: Channels) -> Array:
        result: Array = data.measured[:, BOTH_PRESSURES] @ per_pressure
        return result

    kinds = {rig.muscle(name).valve.kind for name in entry.muscles}
    drive = CrossPhase()
    if problem.has_commands and len(kinds) == 1:
        is_flow = kinds == {"flow"}
        drive = cross_phase(
            [
                (
                    data.commands @ per_pressure,
                    np.gradient(torque(data)) if is_flow else torque(data),
                    data.recording.sample_time,
                )
                for data in free
            ],
            highest,
            rules,
        )
    if not problem.recorded[POSITION]:
        return Directions(drive)

    def motion(sign: float, has_weight: bool) -> CrossPhase:
        """How the joint follows the pressures if its position has this sign."""
        pairs = []
        for data in free:
            position = sign * data.measured[:, POSITION]
            turned = np.pi if data.recording.mounting == TURNED_OVER else 0.0
            net = torque(data)
            if has_weight:
                net = net + np.array([gravity_torque(body, q - turned) for q in position])
            pairs.append((net, position, data.recording.sample_time))
        return cross_phase(pairs, highest, rules)

    found = motion(1.0, has_weight=False)
    is_driven = not problem.has_commands or drive.direction != Direction.UNDECIDED
    as_written = motion(1.0, has_weight=True).direction
    turned = motion(-1.0, has_weight=True).direction
    is_sure = is_driven and (as_written, turned) == (Direction.OPPOSED, Direction.AGREES)
    if found.direction == Direction.OPPOSED and not is_sure:
        found = replace(found, direction=Direction.UNDECIDED)
    return Directions(drive, found)


def valve_phase(problem: PredictionProblem, side: int, highest: float) -> CrossPhase:
    """How the pressure of one muscle (its rate, behind a flow valve) follows its own command.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    side : int
        0 for the agonist, 1 for the antagonist.
    highest : float
        Upper end of the band [Hz].
    """
    name = problem.rig.joints[problem.joint].muscles[side]
    is_flow = problem.rig.muscle(name).valve.kind == "flow"
    pairs = []
    for data in problem.data:
        if data.has_commands and data.recording.mounting != SHUT:
            pressure = data.measured[:, BOTH_PRESSURES][:, side]
            follows = np.gradient(pressure) if is_flow else pressure
            pairs.append((data.commands[:, side], follows, data.recording.sample_time))
    return cross_phase(pairs, highest, problem.rules.recording)


def show_one_muscle(problem: PredictionProblem) -> bool:
    """Whether both pressure sensors show the same pressure although the joint moves."""
    rules = problem.rules.recording
    moved = [d for d in problem.data if d.recording.mounting not in (SHUT, LOCKED)]
    if not moved or not problem.recorded[POSITION]:
        return False
    for data in moved:
        pressures = data.measured[:, BOTH_PRESSURES]
        apart = float(np.std(pressures[:, 0] - pressures[:, 1]))
        noise = float(np.hypot(*data.deviation[BOTH_PRESSURES]))
        swing = float(np.std(pressures[:, AGONIST_PRESSURE]))
        angle = float(np.ptp(data.measured[:, POSITION]))
        lower, upper = problem.rig.joints[problem.joint].position_limits
        same = apart <= max(3.0 * noise, rules.same_pressure * swing)
        if not (same and angle > rules.same_motion * (upper - lower)):
            return False
    return True
