"""Small swings, at rest and in motion, are told with their cause, and nothing else is."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.feedback.swing_watch import (
    begin_swings,
    last_swings,
    reference_changes,
    watch_swings,
)
from pam_control.loop_guard import PAUSE, GuardAction, LoopGuard, Means
from pam_control.plan_memory import Rings
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.rows.telemetry_rows import (
    Z_DRIVEN,
    Z_ERROR,
    Z_POSITION,
    Z_PRESSURES,
    Z_REFERENCE,
    Z_REFERENCE_SPEED,
    Z_SPEED,
    Z_TUBES,
    Z_UNEXPLAINED,
    Z_YIELDS,
)
from pam_control.rows.watch_rows import N_WATCH
from pam_control.settings import ControlSettings
from pam_model.plant.compiled import for_kernel
from pam_model.robot import compose

PERIOD = 0.002
STEP = 3.8e-4  # rad, of the encoder
PUSHES = np.cumsum(np.random.default_rng(2).uniform(0.3, 2.0, 40))  # s


def told(
    error, seconds=6.0, motion=lambda time: (0.0, 0.0), torque=lambda time, velocity: math.nan,
    step=STEP, noise=1e-4,
):  # fmt: skip
    """When the watch tells something of an error over time, and what.

    The encoder has counts of `step` and some noise [rad]. `motion` gives velocity and acceleration
    of the reference, `torque` what the muscles have beside the model [N m] at a velocity of the
    joint [rad/s].
    """
    random, places, watch = np.random.default_rng(1), Rings(1, 3), [0.0] * N_WATCH
    begin_swings(watch, places.ends[0])
    target, before = 0.0, 0.0  # rad
    for k in range(round(seconds / PERIOD)):
        time = k * PERIOD
        seen = step * round((error(time) + noise * random.standard_normal()) / step)
        velocity, acceleration = motion(time)
        changes = reference_changes(watch, velocity, acceleration)
        target += velocity * PERIOD
        rests = float(velocity == 0.0 and acceleration == 0.0)
        true = target - error(time)
        beside, before = torque(time, (true - before) / PERIOD), true
        places.make_room()
        row, ends = places.rows[0], places.ends[0]
        if watch_swings(watch, row, ends, time, seen, target - seen, changes, rests, beside) and (
            what := last_swings(watch, row, ends)
        ):
            return time, what
    return None


def stroke(time, duration=0.8, pause=0.2):
    """Velocity and acceleration of strokes of minimum jerk, there and back."""
    count, within = divmod(time, duration + pause)
    x, sign = within / duration, 1.0 if count % 2 == 0 else -1.0
    if x >= 1.0:
        return 0.0, 0.0
    velocity = 30.0 * x * x * (1.0 - x) ** 2 / duration
    return sign * velocity, sign * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / duration**2


@pytest.mark.parametrize("hertz", [1.0, 2.0, 5.0, 9.0, 15.0])
@pytest.mark.parametrize("swing", [4e-3, 15e-3])
def test_swings_at_rest_are_told_within_three_seconds_with_period_and_size(hertz, swing):
    found = told(lambda t: 0.3 + 0.5 * swing * np.sin(2.0 * np.pi * hertz * t))
    assert found is not None
    time, what = found
    assert time < 3.0
    assert what.size == pytest.approx(swing, abs=0.9e-3)
    assert what.frequency == pytest.approx(hertz, rel=0.2)
    assert what.rests
    assert not what.sticks


ENCODERS = {  # counts and noise [rad]
    "4096 counts": (2.0 * math.pi / 4096, 1e-4),
    "noisy": (1e-5, 4e-4),
    "4096 counts, noisy": (2.0 * math.pi / 4096, 4e-4),
    "1024 counts": (2.0 * math.pi / 1024, 1e-4),
}


@pytest.mark.parametrize("hertz", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("encoder", ENCODERS)
def test_an_encoder_that_flickers_hides_no_swings(encoder, hertz):
    """Every flicker was a turning point, so that 50 mrad at 1 Hz were never seen."""
    step, noise = ENCODERS[encoder]
    for swing in (15e-3, 50e-3) if step < 5e-3 else (50e-3,):
        found = told(
            lambda t, size=0.5 * swing: 0.3 + size * np.sin(2.0 * np.pi * hertz * t),
            step=step, noise=noise,
        )  # fmt: skip
        assert found is not None
        assert found[0] < 3.0
        assert found[1].size == pytest.approx(swing, abs=2.0 * step + 6.0 * noise)
        assert found[1].frequency == pytest.approx(hertz, rel=0.2)


@pytest.mark.parametrize("encoder", ENCODERS)
@pytest.mark.parametrize("moves", [False, True])
def test_an_encoder_that_flickers_is_no_swing(encoder, moves):
    step, noise = ENCODERS[encoder]
    at_rest = 0.5 * step  # between two counts
    assert (
        told(
            lambda t: at_rest + (2e-3 * math.exp(-5.0 * (t % 2.0)) if moves else 0.0),
            30.0, stroke if moves else lambda _: (0.0, 0.0), step=step, noise=noise,
        )
        is None
    )  # fmt: skip


@pytest.mark.parametrize("hertz", [7.0, 9.0, 15.0])
def test_swings_in_motion_are_told_although_the_reference_moves(hertz):
    found = told(lambda t: 4e-3 * np.sin(2.0 * np.pi * hertz * t), motion=stroke)
    assert found is not None
    time, what = found
    assert time < 3.0
    assert what.frequency == pytest.approx(hertz, rel=0.2)


def test_a_joint_that_settles_is_not_told_though_the_end_of_its_motion_swung_less_than_that():
    """A load twice as large, after a sine of 2.6 rad/s; each swing is 0.6 to 0.9 of the last."""
    turns = np.array([-1.0, 0.9, -4.0, 5.0, -2.7, 1.9, -1.0, 0.4, 0.0]) * 1e-3  # rad
    times = 1.0 + np.array([-0.15, 0.0, 0.11, 0.26, 0.42, 0.58, 0.74, 0.9, 1.06])  # s

    def error(time):
        place = np.interp(time, times, np.arange(turns.size))
        at, share = int(place), 0.5 - 0.5 * math.cos(math.pi * (place % 1.0))
        return turns[at] + share * (turns[min(at + 1, turns.size - 1)] - turns[at])

    assert told(error) is None


def test_a_slow_one_of_a_third_of_a_hertz_is_told_after_two_periods():
    found = told(lambda t: 5e-3 * np.sin(2.0 * np.pi * 0.33 * t), seconds=10.0)
    assert found is not None
    assert found[0] < 9.0


def test_a_joint_that_sticks_and_jumps_at_rest_has_another_cause():
    found = told(lambda t: 4e-3 * np.tanh(8.0 * np.sin(2.0 * np.pi * 0.8 * t)))
    assert found is not None
    assert found[1].sticks


def test_a_joint_that_sticks_and_catches_up_while_it_should_move_slowly_is_told_as_one():
    """Its error grows with the reference and falls in a jump: a saw tooth."""
    found = told(
        lambda t: 8e-3 * min((3.0 * t) % 1.0, 9.0 * (1.0 - (3.0 * t) % 1.0)),
        motion=lambda t: (0.027, 0.0),
    )
    assert found is not None
    assert not found[1].rests
    assert found[1].sticks


@pytest.mark.parametrize("speed", [0.08, 0.18, 0.3])
@pytest.mark.parametrize("hertz", [3.0, 4.0])
def test_a_joint_that_stops_in_each_cycle_of_a_motion_sticks_though_its_cycle_is_soft(speed, hertz):
    """Presliding rounds the cycle off until it is like a sine; only its end is that of friction."""
    size = speed / (2.0 * np.pi * hertz)  # rad, of swings which the speed 0 ends
    found = told(lambda t: size * np.sin(2.0 * np.pi * hertz * t), motion=lambda t: (speed, 0.0))
    assert found is not None
    assert found[0] < 3.0
    assert found[1].sticks


@pytest.mark.parametrize("share", [0.5, 0.8, 1.4, 3.0])
@pytest.mark.parametrize("hertz", [3.0, 6.0])
def test_swings_that_do_not_end_where_the_joint_stops_do_not_come_from_sticking(share, hertz):
    """Those of a late loop know nothing of the speed that they are added to."""
    speed = 5e-3 * 2.0 * np.pi * hertz / share  # rad/s, `share` of which is that of the swings
    found = told(lambda t: 5e-3 * np.sin(2.0 * np.pi * hertz * t), motion=lambda t: (speed, 0.0))
    assert found is not None
    assert not found[1].sticks


@pytest.mark.parametrize("speed", [-0.15, 0.0, 0.15])
@pytest.mark.parametrize("friction", [0.0, 0.05, 0.25, 0.5])
def test_friction_is_told_by_the_work_that_its_torque_takes(speed, friction):
    """The inertia of the swings takes as much as it gives; friction takes all the time."""
    hertz, size = 5.0, 4e-3
    omega = 2.0 * np.pi * hertz
    inertia = 0.05 * size * omega**2  # N m, 0.14 from peak to peak of its sine

    def torque(time, velocity):
        return friction * np.sign(velocity) + inertia * np.sin(omega * time)

    found = told(lambda t: size * np.sin(omega * t), motion=lambda t: (speed, 0.0), torque=torque)
    assert found is not None
    assert not found[1].sticks
    if speed != 0.0:
        assert found[1].rubs == (friction >= 0.25)
    else:  # at rest friction reverses with the speed, and swings more itself
        assert not (found[1].rubs and friction < 0.25)


def test_without_torques_nothing_is_told_of_friction():
    found = told(lambda t: 5e-3 * np.sin(30.0 * t), motion=lambda t: (0.3, 0.0))
    assert found is not None
    assert not found[1].rubs


@pytest.mark.parametrize(
    "error",
    [
        lambda t: 0.3,
        lambda t: 1e-3 * np.sin(2.0 * np.pi * 6.0 * t),
        lambda t: 0.05 * np.exp(-t) * t,
        lambda t: 0.03 * np.exp(-4.0 * t) * np.cos(2.0 * np.pi * 3.0 * t),
        lambda t: 0.04 * np.exp(-1.7 * t) * np.cos(2.0 * np.pi * 2.7 * t),
        lambda t: 6e-3 * float(np.exp(-(((t - PUSHES) / 0.1) ** 2)).sum()),
    ],
    ids=["rest", "small swings", "creep", "settling", "settling with a load", "pushes"],
)
def test_nothing_else_is_told_at_rest(error):
    assert told(error, seconds=20.0) is None


@pytest.mark.parametrize(
    "error",
    [
        lambda t: 0.02 * stroke(t)[0],
        lambda t: 2e-3 * stroke(t)[1],
        lambda t: 0.02 * np.tanh(9.0 * stroke(t - 0.03)[0]) if t > 0.03 else 0.0,
        lambda t: 1e-3 * (stroke(t)[1] - stroke(t - 0.05)[1]) if t > 0.05 else 0.0,
    ],
    ids=["damping", "inertia", "dry friction", "jerk"],
)
def test_errors_that_a_motion_causes_are_not_told(error):
    assert told(error, seconds=30.0, motion=stroke) is None


def test_a_slower_one_is_told_in_a_longer_motion():
    found = told(lambda t: 4e-3 * np.sin(2.0 * np.pi * t), 8.0, lambda t: (0.1, 0.0))
    assert found is not None
    assert not found[1].rests
    assert not found[1].sticks


def test_errors_that_follow_a_trembling_reference_are_not_told():
    trembling = 2.0 * np.pi * 5.0
    assert (
        told(
            lambda t: 5e-3 * np.sin(trembling * t),
            seconds=10.0,
            motion=lambda t: (1.0 + np.cos(trembling * t), -trembling * np.sin(trembling * t)),
        )
        is None
    )


def late(rig, closed_loop, delay, seconds):
    """A controller after a small motion and a rest with a hidden delay of the commands [s]."""
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller, command_delay=0.003 + delay)
    loop.run(0.5)
    points = [TrajectoryPoint(0.5, [0.1], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(seconds)
    return controller, loop


def test_a_loop_with_a_long_delay_is_told_and_its_gains_are_lowered_until_it_rests(
    closed_loop, rig
):
    controller, loop = late(rig, closed_loop, 0.03, 3.0)
    guard = controller.guard
    assert "a delay" in guard.swings or guard.softened
    normal = controller.prepared.normal.settings.gains["elbow"].gains[0]
    used = controller.channels[0].setup.gains.gains[0]
    assert used.proportional < 0.7 * normal.proportional
    assert guard.stopped == ""
    loop.run(2.0)
    assert np.ptp(loop.run(1.0).column(1)[-400:]) < 3e-3
    controller.drop_commands()
    assert (guard.swings, guard.lowered) == ("", 0)
    assert controller.channels[0].setup.gains.gains[0] == normal


def test_a_loop_without_one_is_not(closed_loop, rig, reaching):
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(0.5)
    points, duration = reaching
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(duration + 2.0)
    assert controller.guard.swings == ""
    assert controller.guard.lowered == 0


def telemetry(**numbers):
    """The row of one joint; 0 for what is not given, and NaN for the torque beside the model."""
    row = [0.0] * Z_PRESSURES
    row[Z_UNEXPLAINED] = math.nan
    for name, number in numbers.items():
        row[PLACES[name]] = number
    return row


PLACES = {
    "reference": Z_REFERENCE, "reference_speed": Z_REFERENCE_SPEED, "position": Z_POSITION,
    "speed": Z_SPEED, "error": Z_ERROR, "tubes": Z_TUBES, "unexplained": Z_UNEXPLAINED,
    "yields": Z_YIELDS, "driven": Z_DRIVEN,
}  # fmt: skip


def judged(guard, time, rows, means):
    return guard.judge(time, for_kernel(np.array(rows)), 0.3, means)


def swinging(
    guard, behind_tube=0, steps=2, size=lambda time: 6e-3, hertz=5.0, speed=0.0, torque=math.nan
):
    """What the guard asks for, with the times [s], of a joint that swings, at rest or in motion."""
    asked, means = [], Means(True, steps, [14.0])
    for k in range(round(8.0 / PERIOD)):
        time = k * PERIOD
        error = 0.5 * size(time) * np.sin(2.0 * np.pi * hertz * time)
        joint = telemetry(
            reference=speed * time, reference_speed=speed, position=speed * time - error,
            speed=speed, error=error, tubes=behind_tube, unexplained=torque,
        )  # fmt: skip
        verdict = judged(guard, time, [joint], means)
        if verdict is not GuardAction.NOTHING:
            asked.append((time, verdict))
        if verdict is GuardAction.STOP:
            break
    return asked


def test_swings_that_grow_lower_the_gains_then_bring_the_soft_ones_then_stop(rig):
    guard = LoopGuard(compose(rig).joints)
    asked = swinging(guard, size=lambda time: 4e-3 * (1.0 + time))
    lower, soften = GuardAction.LOWER, GuardAction.SOFTEN
    assert [verdict for _, verdict in asked] == [lower, lower, soften, GuardAction.STOP]
    times = [time for time, _ in asked]
    assert times[0] < 3.0
    assert np.diff(times).min() > PAUSE
    assert "with soft gains it swings as widely" in guard.stopped
    assert "5 Hz" in guard.swings


def test_swings_that_do_not_grow_are_told_and_leave_the_adaptation_at_work(rig):
    guard = LoopGuard(compose(rig).joints)
    assert [verdict for _, verdict in swinging(guard)] == [GuardAction.LOWER, GuardAction.LOWER]
    assert (guard.softened, guard.stopped) == ("", "")
    assert guard.swings


def test_small_swings_bring_no_soft_gains_though_they_grow_and_stop_nothing_with_these(rig):
    """Soft gains leave larger errors of friction than such swings are; the joint was stopped."""
    guard = LoopGuard(compose(rig).joints)
    asked = swinging(guard, size=lambda time: 3e-3 * (1.0 + time))
    assert [verdict for _, verdict in asked] == [GuardAction.LOWER, GuardAction.LOWER]
    guard.softened = "the joint oscillates"
    guard.restart()
    assert swinging(guard, size=lambda _: 0.02) == []


def test_swings_slower_than_the_loop_come_from_outside_and_leave_the_gains(rig):
    """Somebody pushes again and again; with lower gains the joint would yield more."""
    guard = LoopGuard(compose(rig).joints)
    assert swinging(guard, hertz=1.0) == []
    assert "outside torque" in guard.swings


@pytest.mark.parametrize("whose", ["yields", "driven"])
def test_the_swings_of_a_joint_that_others_move_are_not_watched(rig, whose):
    guard = LoopGuard(compose(rig).joints)
    for k in range(4000):
        error = 3e-3 * np.sin(2.0 * np.pi * 5.0 * k * PERIOD)
        joint = telemetry(position=-error, error=error, **{whose: 1.0})
        assert judged(guard, k * PERIOD, [joint], Means(True, 2, [14.0])) is GuardAction.NOTHING
    assert guard.swings == ""


def test_another_cause_is_told_after_somebody_has_pushed(rig):
    """The gains were lowered without a word, since swings had been told before."""
    guard = LoopGuard(compose(rig).joints)
    assert swinging(guard, hertz=1.0) == []
    guard.restart()
    assert GuardAction.LOWER in [verdict for _, verdict in swinging(guard, hertz=5.0)]
    first, second = guard.swings.split("; elbow: ")
    assert "outside torque" in first
    assert "a delay" in second


def test_the_swings_of_every_joint_are_told(rig):
    joint = compose(rig).joints[0]
    guard = LoopGuard([joint, replace(joint, name="wrist")])
    for k in range(4000):
        time, joints = k * PERIOD, []
        for begins, hertz in ((0.0, 1.0), (4.0, 0.8)):
            error = 3e-3 * np.sin(2.0 * np.pi * hertz * time) * (time >= begins)
            joints.append(telemetry(position=-error, error=error))
        judged(guard, time, joints, Means(True, 2, [14.0, 14.0]))
    assert re.findall(r"(\w+): the joint swings", guard.swings) == ["elbow", "wrist"]


def test_a_joint_that_sticks_in_motion_keeps_its_gains(rig):
    """With softer feedback it would stand longer and jump farther."""
    guard, hertz = LoopGuard(compose(rig).joints), 4.0
    asked = swinging(guard, hertz=hertz, speed=3e-3 * 2.0 * np.pi * hertz)
    assert asked == []
    assert "in motion" in guard.swings
    assert "dry friction that sticks" in guard.swings


@pytest.mark.parametrize(("torque", "is_friction"), [(0.4, True), (-0.4, False), (0.0, False)])
def test_a_joint_that_rubs_in_motion_keeps_its_gains_and_both_causes_are_told(
    rig, torque, is_friction
):
    """A torque that drives the joint, such as that of a load, is no friction."""
    guard = LoopGuard(compose(rig).joints)
    asked = swinging(guard, speed=0.4, torque=torque)
    assert ("dry friction or hysteresis" in guard.swings) == is_friction
    assert "a delay" in guard.swings
    assert (asked == []) == is_friction


def test_an_oscillation_is_told_with_its_likely_cause(rig):
    """The first of a long delay grows so fast that it is fast before it is an even swing."""
    guard = LoopGuard(compose(rig).joints)
    means, hertz = Means(True, 2, [14.0]), 7.0
    omega = 2.0 * np.pi * hertz
    for k in range(round(3.0 / PERIOD)):
        time = k * PERIOD
        size = 1e-3 * np.exp(4.0 * time)
        error = size * np.sin(omega * time)
        joint = telemetry(position=-error, speed=-size * omega * np.cos(omega * time), error=error)
        if judged(guard, time, [joint], means) is GuardAction.SOFTEN:
            break
    assert "oscillates" in guard.softened
    assert "likely cause: a delay" in guard.softened


def test_a_tube_that_was_found_is_the_likely_cause(rig):
    guard = LoopGuard(compose(rig).joints)
    swinging(guard, behind_tube=1)
    assert "likely cause: a tube" in guard.swings


def test_lowered_gains_are_safe_at_every_stiffness(rig):
    prepared = Controller(rig, ControlSettings()).prepared
    margins = [loops.margins[0][0].phase_margin for loops in prepared.lowered]
    assert len(margins) == 2
    assert min(margins) > prepared.normal.margins[0][0].phase_margin
