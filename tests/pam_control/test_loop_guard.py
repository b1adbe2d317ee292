"""A loop with a delay that nobody knows of: it keeps tracking, or it stops, and is never fast."""

import dataclasses
import math
import random
from collections import deque

import numpy as np
import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.feedback.motion_watch import (
    LOST,
    NOTHING,
    begin_oscillation,
    begin_tracking,
    is_lost,
    watch_oscillation,
    what_was_found,
)
from pam_control.loop_guard import LoopGuard
from pam_control.plan_memory import Rings
from pam_control.rows.watch_rows import B_FOUND, B_LARGEST_ERROR, B_LARGEST_SPEED, N_WATCH
from pam_control.settings import ControlSettings
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant

TICK = 1e-3
QUANTUM = 2.0 * math.pi / 2**14
TOLD_UP, TOLD_DOWN = 0.001, 0.003  # s, the delays that the settings state
START = 2.0


@dataclasses.dataclass
class Outcome:
    """Peak speed while commands are sent [rad/s], largest error [rad], and why it stopped."""

    speed: float
    error: float
    stopped: str
    softened: str


def play(controller, points, duration, *, up=0.0, down=0.0, effects=None, pauses=(0.0, 1.0)):
    """Follow a motion with hidden delays [s]; the stamps show nothing of them.

    The measurements are late by `up`, the commands by `down`, in addition to what the settings say.
    The loop stands still for the first of `pauses` in each period of the second [s].
    """
    rig = controller.rig
    plant = Plant(PlantParameters.from_rig(rig).replaced(effects or {}))
    noise = random.Random(4)
    controller.drop_commands()
    sensed, sent = deque(), deque()
    applied, shown, latest = (0.0, 0.0), (0.0, 0.0, 0.0), None
    positions, times, errors, following = [], [], [], False
    name = rig.joint_names[0]
    for tick in range(round((START + duration + 0.5) / TICK)):
        time = tick * TICK
        if tick % 2 == 0:
            pressures = [p + noise.gauss(0.0, 70.0) for p in shown[1:]]
            sensed.append((time, round(shown[0] / QUANTUM) * QUANTUM, pressures))
            while sensed and sensed[0][0] <= time - TOLD_UP - up + 1e-9:
                latest = sensed.popleft()
            if latest is not None and not (time >= START and time % pauses[1] < pauses[0]):
                if not following and time >= START and controller.active:
                    controller.references.follow([name], points, start=None, now=time)
                    following = True
                stamp = latest[0] + up
                output = controller.step(time, Measurement([latest[1]], latest[2], stamp, stamp))
                if output.commands is None:
                    break
                sent.append((time + TOLD_DOWN + down, output.commands))
                positions.append(plant.output["position"])
                times.append(time)
                if time >= START:
                    reference = controller.references.sample(name, time).position
                    errors.append(abs(reference - positions[-1]))
        while sent and sent[0][0] <= time + 1e-9:
            applied = sent.popleft()[1]
        shown = plant.step(applied, TICK)
    speed = np.abs(np.diff(positions) / np.diff(times)).max()
    guard = controller.guard
    return Outcome(float(speed), max(errors, default=0.0), guard.stopped, guard.softened)


@pytest.fixture(scope="module")
def controller(rig):
    return Controller(rig, ControlSettings())


@pytest.mark.sampled("six delays between none and 80 ms", cases=6)
@pytest.mark.parametrize("way", ["up", "down"])
@pytest.mark.parametrize("delay", range(0, 85, 5))
def test_with_any_hidden_delay_the_joint_stays_below_its_limit_and_tracks_or_stops(
    controller, reaching, delay, way
):
    outcome = play(controller, *reaching, **{way: 1e-3 * delay})
    assert outcome.speed < controller.rig.joints[0].max_velocity
    assert outcome.stopped or outcome.error < 0.25


@pytest.mark.sampled("three of the delays, on either way", cases=3)
@pytest.mark.parametrize("way", ["up", "down"])
@pytest.mark.parametrize("delay", range(0, 25, 5))
def test_a_delay_that_the_design_bears_changes_no_gains(controller, reaching, delay, way):
    outcome = play(controller, *reaching, **{way: 1e-3 * delay})
    assert (outcome.softened, outcome.stopped) == ("", "")
    assert outcome.error < 0.07


@pytest.mark.parametrize("pauses", [(0.026, 0.06), (0.04, 0.06), (0.04, 0.1)])
def test_a_loop_that_pauses_again_and_again_is_stopped_before_it_shakes_the_joint(
    controller, reaching, pauses
):
    outcome = play(controller, *reaching, pauses=pauses)
    assert "the control loop paused" in outcome.stopped
    assert outcome.speed < 0.6 * controller.rig.joints[0].max_velocity


@pytest.mark.parametrize("pauses", [(0.04, 0.2), (0.012, 0.03)])
def test_rare_and_short_pauses_are_borne(controller, reaching, pauses):
    outcome = play(controller, *reaching, pauses=pauses)
    assert outcome.stopped == ""
    assert outcome.error < 0.1


def test_only_pauses_within_half_a_second_count(controller):
    guard = LoopGuard(controller.robot.joints)
    for time in (1.0, 1.3, 1.6, 1.9):
        assert guard.watch_gaps(time, 0.07, 0.016) == ""
    assert guard.watch_gaps(2.0, 0.016, 0.016) == ""
    assert "paused 3 times for more than 16 ms" in guard.watch_gaps(2.05, 0.03, 0.016)
    assert guard.stopped
    guard.clear()
    assert guard.watch_gaps(3.0, 10.0, 0.016) == "", "one long pause is a matter of the time-outs"


def test_a_hidden_lag_of_the_pressure_sensors_is_no_limit_cycle(controller, reaching):
    outcome = play(controller, *reaching, effects={"pressure_lag.time_constant": 0.026})
    assert outcome.speed < controller.rig.joints[0].max_velocity
    assert outcome.stopped or outcome.error < 0.25


ENCODER_NOISE = 1.5e-4  # rad; differences of errors below it do not count


@pytest.mark.sampled("one of the two motions", cases=1)
@pytest.mark.parametrize("fixture", ["reaching", "chirp"])
def test_the_reserve_for_an_unknown_delay_costs_little_on_a_rig_without_one(
    request, rig, closed_loop, fixture
):
    points, duration = request.getfixturevalue(fixture)
    found = []
    for extra in (0.0, 0.01):
        loop = closed_loop(Controller(rig, ControlSettings(extra_delay=extra)))
        loop.run(START)
        loop.controller.references.follow(["elbow"], points, start=None, now=loop.time)
        found.append(loop.run(duration + 0.2).rms(START))
    assert found[1] < max(1.3 * found[0], ENCODER_NOISE)


def test_soft_gains_stay_until_the_next_vent_and_not_longer(controller, reaching):
    normal = controller.prepared.normal.settings.gains
    play(controller, *reaching, up=0.035)
    assert "oscillates" in controller.guard.softened
    assert controller.settings.gains != normal
    controller.change(controller.prepared.asked.replace(pressure_rate=3e6))
    assert controller.settings.gains != normal
    controller.drop_commands()
    assert controller.guard.softened == ""
    assert controller.settings.gains == normal


def test_a_stop_is_latched_until_the_next_vent(rig):
    slack = rig.with_joint(dataclasses.replace(rig.joints[0], max_tracking_error=0.1))
    controller = Controller(slack, ControlSettings())
    measured = [[0.0], [1e5, 1e5]]
    controller.step(0.0, Measurement(*measured, 0.0, 0.0))
    controller.references.stream(["elbow"], [0.5], now=0.0)
    outputs = []
    for cycle in range(1, 500):
        now = 0.002 * cycle
        controller.references.stream(["elbow"], [0.5], now=now)  # the joint is held by a hand
        outputs.append(controller.step(now, Measurement(*measured, now, now)))
    assert outputs[0].commands is not None
    assert outputs[-1].commands is None
    assert "tracking error" in outputs[-1].reason
    assert "max_tracking_error" in outputs[-1].reason
    controller.drop_commands()
    assert controller.step(1.0, Measurement(*measured, 1.0, 1.0)).commands is not None


class SpeedWatch:
    """Watches the speed of one joint, of at most 6 rad/s."""

    def __init__(self):
        self._row, self._peaks = [0.0] * N_WATCH, Rings(1, 2)
        self._row[B_LARGEST_SPEED] = 6.0
        begin_oscillation(self._row, self._peaks.ends[0])

    def update(self, time, reference_speed, speed):
        """What is found, in words."""
        self._peaks.make_room()
        peaks, ends = self._peaks.rows[0], self._peaks.ends[0]
        found = watch_oscillation(self._row, peaks, ends, time, reference_speed, speed)
        self._row[B_FOUND] = found
        return "" if found == NOTHING else what_was_found(self._row, time, 0.0, speed)


def oscillation(growth, frequency=4.0, amplitude=0.3, reference=0.0):
    """Time of the verdict on an oscillation of the speed whose peaks grow by `growth`; or None."""
    watch = SpeedWatch()
    for cycle in range(1000):
        time = 0.002 * cycle
        size = amplitude * growth ** (2.0 * frequency * time)
        carried = reference * math.sin(2.0 * math.pi * 0.6 * time)
        speed = carried + size * math.sin(2.0 * math.pi * frequency * time)
        if watch.update(time, carried, speed):
            return time
    return None


def test_an_oscillation_that_grows_or_lasts_is_seen_within_two_periods():
    for frequency in (2.0, 4.0, 8.0):
        for growth in (1.0, 1.3, 2.0):
            seen = oscillation(growth, frequency, 0.6)
            assert seen is not None
            assert seen <= 2.0 / frequency


def test_what_fades_is_no_oscillation():
    assert oscillation(0.6, amplitude=4.0) is None


def test_noise_is_no_oscillation():
    assert oscillation(1.0, amplitude=0.2) is None


def test_errors_that_are_small_beside_the_motion_are_no_oscillation():
    assert oscillation(1.0, amplitude=0.7, reference=2.5) is None
    assert oscillation(1.0, amplitude=0.7, reference=0.5) is not None


@pytest.mark.parametrize("phase", [30.0, 60.0, 90.0])
@pytest.mark.parametrize("frequency", [0.5, 1.0, 2.0])
def test_a_joint_that_lags_behind_a_fast_reference_does_not_oscillate(frequency, phase):
    watch = SpeedWatch()
    for cycle in range(2000):
        angle = 2.0 * math.pi * frequency * 0.002 * cycle
        speeds = 3.0 * math.cos(angle), 3.0 * math.cos(angle - math.radians(phase))
        assert watch.update(0.002 * cycle, *speeds) == ""


def test_an_oscillation_is_seen_during_a_fast_reference():
    watch = SpeedWatch()
    for cycle in range(1000):
        time = 0.002 * cycle
        carried = 2.5 * math.cos(2.0 * math.pi * 1.5 * time)
        wild = min(2.0 * time, 1.0) * 3.0 * math.cos(2.0 * math.pi * 6.0 * time)
        if watch.update(time, carried, carried + wild):
            break
    assert time < 1.0


def test_a_joint_that_is_nearly_too_fast_without_a_reason_is_told_at_once():
    assert "5 rad/s" in SpeedWatch().update(0.0, 0.0, 5.0)
    assert "5 rad/s" in SpeedWatch().update(0.0, 2.0, 5.0)


def test_the_overshoot_of_a_fast_step_is_no_reason_for_an_alarm():
    assert SpeedWatch().update(0.0, 3.3, 5.0) == ""


def test_a_short_tracking_error_is_borne_and_a_lasting_one_is_not():
    row = [0.0] * N_WATCH
    row[B_LARGEST_ERROR] = 0.2
    begin_tracking(row)
    for time, error in ((0.0, 0.5), (0.2, 0.1), (0.3, -0.5), (0.5, -0.5)):
        assert not is_lost(row, time, error, 0.3)
    assert is_lost(row, 0.6, -0.5, 0.3)
    row[B_FOUND] = LOST
    assert "for 0.30 s" in what_was_found(row, 0.6, -0.5, 0.0)
