"""Motions that are repeated: they become more exact, or the learning ends and says why."""

from __future__ import annotations

import errno
import itertools
import json
import math
import os

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.learning import learnt_file
from pam_control.learning.learning_filter import (
    UNKNOWN_DELAYS,
    LearningFilter,
    later,
    minimax_inverse,
)
from pam_control.learning.learnt_file import (
    LARGEST_FILE,
    LONGEST_READING,
    LearntFile,
    read_motions,
)
from pam_control.learning.motion_learner import MotionLearner
from pam_control.learning.repeated_motion import TAIL, Learnt, RepeatedMotion, RepetitionRecord
from pam_control.references.spline import JointSpline, Waypoint
from pam_control.settings import ControlSettings
from pam_model.errors import PamError

from .conftest import points_of

PERIOD = 0.002
FRICTION = {"coulomb_friction.torque": 0.5}


def law(rig, **settings):
    return Controller(rig, ControlSettings(adaptation=True, **settings))


@pytest.fixture(scope="module")
def there_and_back():
    duration = 1.6

    def position(t):
        x = max(0.0, min(1.0, t / duration))
        return 0.4 * 64.0 * (x * (1.0 - x)) ** 3

    return points_of(position, duration), duration


def repeat(closed_loop, controller, motion, **options):
    """RMS error [rad] of one repetition of a motion."""
    points, duration = motion
    loop = closed_loop(controller, **options)
    controller.drop_commands()
    loop.run(0.6)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    error = loop.run(duration).rms(0.6)
    loop.run(0.4)
    learner = controller.channels[0].setup.learner
    if learner is not None:
        learner.wait()
    return error


def test_five_repetitions_bring_the_error_of_friction_to_a_quarter(
    closed_loop, rig, there_and_back, tmp_path
):
    kept = tmp_path / "learnt.json"
    controller = law(rig, learning_motion="reach", learning_file=str(kept))
    errors = [repeat(closed_loop, controller, there_and_back, effects=FRICTION) for _ in range(5)]
    assert errors[-1] < 0.25 * errors[0]
    assert max(errors[1:]) <= errors[0]
    # another controller knows the motion from the file
    later = law(rig, learning_motion="reach", learning_file=str(kept))
    assert repeat(closed_loop, later, there_and_back, effects=FRICTION) < 0.4 * errors[0]
    # and none of another name
    other = law(rig, learning_motion="other", learning_file=str(kept))
    assert other.channels[0].setup.learner.motion.best is None


def test_an_interrupted_motion_teaches_nothing(closed_loop, rig, there_and_back):
    controller = law(rig, learning_motion="reach")
    points, duration = there_and_back
    loop = closed_loop(controller)
    loop.run(0.3)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(0.5 * duration)
    controller.stop(loop.time)
    loop.run(duration)
    controller.channels[0].setup.learner.wait()
    assert controller.channels[0].setup.learner.motion.history == []


def test_soft_gains_play_nothing_that_was_learnt(rig):
    controller = law(rig, learning_motion="reach")
    assert controller.channels[0].setup.learner is not None
    controller.guard.softened = "the joint oscillates"
    controller.use(controller.prepared)
    assert controller.channels[0].setup.learner is None


def test_another_parameter_keeps_what_was_learnt_and_another_name_does_not(rig):
    controller = law(rig, learning_motion="reach")
    before = controller.channels[0].setup.learner
    controller.change(controller.prepared.asked.replace(integral_limit=4.0))
    assert controller.channels[0].setup.learner is before
    controller.change(controller.prepared.asked.replace(learning_motion="wave"))
    assert controller.channels[0].setup.learner is not before
    controller.change(controller.prepared.asked.replace(learning_motion=""))
    assert controller.channels[0].setup.learner is None


# --- the filter ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def filter_and_responses(rig):
    controller = law(rig)
    channel, settings = controller.channels[0], controller.settings.replace(extra_delay=0.0)
    cases = controller.design.cases(
        channel.models, settings.replace(stiffness_grid=(12.0, 14.0, 16.0))
    )
    timing = controller.design.timing(channel.models, settings)
    return LearningFilter("elbow", cases, timing, settings.gains["elbow"].at(14.0)), cases, timing


@pytest.mark.parametrize("delay", UNKNOWN_DELAYS)
def test_errors_become_smaller_at_every_repetition_for_the_whole_range(filter_and_responses, delay):
    filter, cases, timing = filter_and_responses
    count = 4096
    time = PERIOD * np.arange(count)
    wanted = np.exp(-(((time - 4.0) / 0.6) ** 2)) * np.sin(9.0 * time)  # N m, of 1.4 Hz
    omega = 2.0 * math.pi * np.fft.rfftfreq(count, PERIOD)
    omega[0] = omega[1]
    for case in cases:
        late = later(timing, delay)
        response = filter.closed_response(case, late, omega)
        torque, errors = np.zeros(count), []
        for _ in range(6):
            spectrum = np.fft.rfft(wanted - torque) * response
            error = np.fft.irfft(spectrum, count)
            errors.append(float(np.sqrt(np.mean(error**2))))
            torque = filter.next_torque(torque, error, PERIOD)
        floor = 0.1 * errors[0]  # what Q leaves
        for before, after in itertools.pairwise(errors):
            assert after < max(before, floor)
        assert errors[-1] < 0.3 * errors[0]


def test_the_inverse_is_the_best_for_the_worst_plant():
    """A least-squares inverse follows the majority."""
    responses = np.array([[1.0], [1.0], [1.0], [1.0], [3.0]], dtype=complex)
    (inverse,) = minimax_inverse(responses)
    assert inverse.real == pytest.approx(0.5, rel=0.05)  # |1 - L| = |1 - 3 L|
    assert np.abs(1.0 - inverse * responses).max() < 0.55


def test_the_filter_reaches_the_crossover_with_the_gains_of_the_schedule(filter_and_responses):
    filter, _, _ = filter_and_responses
    assert filter.cut_off > 30.0
    assert filter.contraction < 0.9


# --- the bookkeeping -----------------------------------------------------------------------------


class Adding:
    """A filter that adds the error."""

    def next_torque(self, torque, error, period):
        return torque + error


def recording(error, path=0.1):
    times = [PERIOD * k for k in range(11)]
    return RepetitionRecord(times, [error] * 11, [0.0] * 11, [path] * 11)


def test_a_worse_repetition_ends_the_learning_and_the_best_is_used():
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    for error in (0.01, 0.006, 0.02):
        motion.take(recording(error))
    assert motion.played is motion.best
    assert motion.best.error == pytest.approx(0.006)
    assert motion.corrected(0.0)[1] == pytest.approx(0.01)
    assert "repetition 3 had 20.00 mrad" in motion.ended
    motion.take(recording(0.001))
    assert motion.corrected(0.0)[1] == pytest.approx(0.01)


def test_what_does_not_repeat_averages_out():
    """Otherwise each repetition would play the noise of the one before, with the opposite sign."""
    random = np.random.default_rng(1)
    noise, count = 0.1, 4000
    wanted = np.sin(0.05 * np.arange(count))
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    shares = []
    for _ in range(8):
        played = 0.0 if motion.played is None else motion.played.correction
        error = wanted - played + noise * random.standard_normal(count)
        times = [PERIOD * k for k in range(count + 1)]
        motion.take(RepetitionRecord(times, [*error, 0.0], [0.0] * len(times), [0.1] * len(times)))
        shares.append(motion.share)
    assert shares[0] == 1.0
    assert motion.ended == ""
    left = wanted - motion.played.correction
    assert float(np.sqrt(np.mean(left**2))) < 0.65 * noise, "all of the last error would leave 1.0"


def test_errors_that_repeat_are_learnt_as_a_whole():
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    for error in (0.01, 0.006, 0.004, 0.001):
        motion.take(recording(error))
    assert motion.share == 1.0


def repetitions_of_a_joint_that_answers(share, count):
    """RMS errors [rad] of a joint that answers with a share of what the filter expects."""
    wanted = np.sin(0.05 * np.arange(500))
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    times = [PERIOD * k for k in range(wanted.size + 1)]
    for _ in range(count):
        played = 0.0 if motion.played is None else motion.played.correction
        error = wanted - share * played
        motion.take(RepetitionRecord(times, [*error, 0.0], [0.0] * len(times), [0.1] * len(times)))
    assert motion.ended == ""
    return np.array(motion.history)


def test_a_joint_that_answers_little_is_learnt_in_longer_steps():
    """Friction holds the joint: with steps as the filter has them, 0.8 of an error would remain."""
    errors = repetitions_of_a_joint_that_answers(0.2, 7)
    assert errors[-1] < 0.6**5 * 1.01 * errors[0]


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8, 1.0, 1.3, 1.7])
def test_longer_steps_make_no_repetition_worse_than_the_one_before(share):
    errors = repetitions_of_a_joint_that_answers(share, 8)
    assert np.all(np.diff(errors) < 1e-9)
    assert errors[-1] < 0.05 * errors[0]


def test_another_motion_under_the_same_name_is_not_mixed_with_it():
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    motion.take(recording(0.01))
    before = motion.played
    motion.take(recording(0.001, path=0.3))
    assert motion.played is before
    assert "another motion" in motion.ended


def test_late_cycles_do_not_matter_and_missing_ones_teach_nothing():
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    times = [PERIOD * k + 5e-4 * (k % 2) for k in range(11)]
    motion.take(RepetitionRecord(times, [0.01] * 11, [0.0] * 11, [0.1] * 11))
    motion.take(recording(0.006))
    assert motion.history == pytest.approx([0.01, 0.006])
    late = [*times[:6], *(time + 0.1 for time in times[6:])]
    motion.take(RepetitionRecord(late, [0.5] * 11, [0.0] * 11, [0.1] * 11))
    assert len(motion.history) == 2
    assert motion.ended == ""


def test_what_was_recorded_is_not_played_before_the_motion_begins():
    """The first recorded torque looks ahead; some cycles too early it would kick the joint."""
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    times = [PERIOD * k for k in range(200)]
    motion.take(RepetitionRecord(times, [0.01] * 200, [0.2] * 200, [0.1] * 200))
    learner = MotionLearner(motion)
    end = 5.0 + PERIOD * 200 - TAIL
    learner.follow(JointSpline([Waypoint(5.0, 0.1, 0.0, 0.0), Waypoint(end, 0.1, 0.0, 0.0)]))
    assert learner.torque(5.0 - PERIOD, 0.5)[0] == 0.5
    assert learner.torque(5.0, 0.5)[0] == pytest.approx(0.2)


def test_another_trajectory_is_not_played_with_what_was_learnt():
    motion = RepeatedMotion(Adding(), PERIOD, 1)
    learner = MotionLearner(motion)

    def spline(goal):
        return JointSpline([Waypoint(5.0, 0.0, 0.0, 0.0), Waypoint(5.4, goal, 0.0, 0.0)])

    def play(goal):
        learner.interrupt()
        followed = spline(goal)
        given = []
        for k in range(400):
            learner.follow(followed)
            given.append(learner.torque(5.0 + PERIOD * k, 0.0)[1])
            now = 5.0 + PERIOD * k
            learner.record(now, 0.01, 0.0, followed.sample(now).position)
        learner.wait()
        return given

    play(0.3)
    assert max(play(0.3)) > 0.0
    assert max(play(-0.3)) == 0.0
    assert "another motion" in motion.ended


def test_the_adaptation_learns_before_the_repetitions_do():
    motion = RepeatedMotion(Adding(), PERIOD, 2)
    motion.take(recording(0.01))
    assert motion.corrected(0.0) is None
    motion.take(recording(0.005))
    assert motion.corrected(0.0) == (0.0, 0.005)


def known():
    return Learnt(np.full(4, 0.1), np.full(4, 0.2), np.array([0.0, 1.0, -1.0, 0.0]), 2e-3)


def test_what_was_learnt_is_kept_by_name_and_for_one_rig_file_alone(rig, two_joint_rig, tmp_path):
    path = tmp_path / "deep" / "learnt.json"
    LearntFile(path, rig).keep("reach", "elbow", known())
    same = LearntFile(path, rig)
    assert same.motion("wave") == {}
    assert same.motion("reach")["elbow"].correction == pytest.approx(known().correction)
    assert same.motion("reach")["elbow"].error == 2e-3
    other = LearntFile(path, two_joint_rig)
    assert other.motion("reach") == {}
    assert "another rig file" in other.note


def test_a_full_disk_is_not_filled_with_what_is_left_of_every_attempt(rig, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    file = LearntFile(tmp_path / "learnt.json", rig)
    monkeypatch.setattr(json, "dump", full)
    for _ in range(3):
        with pytest.raises(OSError, match="No space left"):
            file.keep("reach", "elbow", known())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "said"), [(".", "no ordinary file"), ("x" * 300, "File name too long")]
)
def test_a_path_that_can_be_no_file_is_refused_at_once(rig, tmp_path, name, said):
    """Not by an exception after the first repetition, or one that ends the controller."""
    with pytest.raises(PamError, match=said):
        LearntFile(tmp_path / name, rig)


@pytest.mark.parametrize(
    "damage",
    [
        "no JSON",
        lambda content: content["motions"]["reach"]["elbow"].pop("base"),
        lambda content: content["motions"]["reach"]["elbow"]["base"].pop(),
        lambda content: content.update(motions=[1]),
    ],
)
def test_a_damaged_file_is_one_line_that_names_it(rig, tmp_path, damage):
    path = tmp_path / "learnt.json"
    LearntFile(path, rig).keep("reach", "elbow", known())
    if callable(damage):
        content = json.loads(path.read_text())
        damage(content)
        path.write_text(json.dumps(content))
    else:
        path.write_text(damage)
    with pytest.raises(PamError, match=r"learnt\.json: not a file of learnt motions"):
        LearntFile(path, rig)


def _deep(path):
    path.write_text('{"rig": ' + "[" * 200_000)


def _large(path):
    with path.open("wb") as file:
        file.truncate(LARGEST_FILE + 1)


def _pipe(path):
    os.mkfifo(path)


def _overflowing(path):
    path.write_text(path.read_text().replace("0.002", "1" + "0" * 400))


@pytest.mark.parametrize(
    ("damage", "said"),
    [(_deep, "nested too deeply"), (_large, "larger than"), (_pipe, "no ordinary file"),
     (_overflowing, "not a file of learnt motions")],
)  # fmt: skip
def test_a_hostile_file_costs_neither_time_nor_a_traceback(rig, tmp_path, damage, said):
    path = tmp_path / "learnt.json"
    LearntFile(path, rig).keep("reach", "elbow", known())
    if damage is not _overflowing:
        path.unlink()
    damage(path)
    with pytest.raises(PamError, match=said):
        LearntFile(path, rig)


def test_the_file_is_read_in_the_process_of_the_designs_within_a_time(rig, tmp_path):
    """A large file in the process of the control loop would hold the interpreter's lock."""
    asked = []

    def read(function, *arguments, within):
        asked.append((function, within))
        return function(*arguments)

    LearntFile(tmp_path / "learnt.json", rig, read)
    assert asked == [(read_motions, LONGEST_READING)]


def test_a_file_does_not_grow_beyond_what_is_read_again(rig, tmp_path, monkeypatch):
    path = tmp_path / "learnt.json"
    file = LearntFile(path, rig)
    file.keep("reach", "elbow", known())
    before = path.read_text()
    monkeypatch.setattr(learnt_file, "LARGEST_FILE", 300)
    with pytest.raises(OSError, match="more than 300 bytes"):
        file.keep("wave", "elbow", known())
    assert path.read_text() == before
    assert list(tmp_path.iterdir()) == [path]
