"""A commissioning moves only what is wired rightly, within the limits, and as far as is known."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from pam_demo.commission.knowledge import Known, as_written, easily_turned, narrowed
from pam_demo.commission.least_favourable import (
    PLANNED,
    Foreseen,
    design,
    foreseen,
    least_favourable,
    permitted,
)
from pam_demo.commission.motion_loop import NEARLY_EMPTY, scale_of
from pam_demo.commission.motions import filling, staircase, steps
from pam_demo.commission.play import play, start_up_check, touch, vented
from pam_demo.commission.robot_port import JointReading
from pam_demo.commission.ros_port_node import age_of_stamp
from pam_demo.commission.simulated_port import SimulatedPort
from pam_demo.commission.tracking import controller_for, reaches, track
from pam_demo.commission.watch import Limits, Seen, watched
from pam_gap.calibration.calibration import DETERMINED, KEPT, CalibratedNumber
from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.free_numbers import Said
from pam_model.rig import Rig, load_rig
from pam_model.rig.partial import PartialRig, load_partial_rig
from pam_model.rig.types import NUMBERS
from support.commission_ports import EXCHANGES, PERIOD, WiredPort

ROOT = Path(__file__).parents[2]
SAID = Said(1.0 / 3.0, 0.05)
LIMITS = Limits((6e5, 5e5), 6.0, -1.0, 1.0)


@pytest.fixture(scope="module")
def elbow() -> Rig:
    return load_rig(ROOT / "config" / "elbow.yaml")


@pytest.fixture(scope="module")
def known(elbow: Rig) -> tuple[Known, ...]:
    return as_written(PartialRig(elbow), SAID, CalibrationRules())


# --- the watch ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reading", "word"),
    [
        (JointReading(1.0, math.nan, (1e5, 1e5)), "missing"),
        (JointReading(1.0, 0.0, (1e5, math.nan)), "missing"),
        (JointReading(1.0, 0.0, (1e5, 4.9e5)), "Pa"),
        (JointReading(1.0, 0.2, (1e5, 1e5)), "rad/s"),
        (JointReading(1.0, 0.97, (1e5, 1e5)), "end of its range"),
        (JointReading(1.0, -0.97, (1e5, 1e5)), "end of its range"),
    ],
)
def test_what_leaves_the_limits_or_is_missing_ends_a_motion(
    reading: JointReading, word: str
) -> None:
    outward = math.copysign(0.01, reading.position) if abs(reading.position) > 0.5 else 0.0
    before = Seen(0.996, reading.position - outward, 0.0)
    if word == "rad/s":
        before = Seen(0.996, 0.0, 5.0)
    assert word in watched(before, reading, LIMITS)[1]


def test_a_joint_at_rest_within_its_limits_goes_on() -> None:
    seen = Seen()
    for k in range(10):
        seen, reason = watched(seen, JointReading(0.004 * k, 0.3, (1e5, 2e5)), LIMITS)
        assert not reason
    hanging = Seen(0.0, 0.99, 0.0)
    assert not watched(hanging, JointReading(0.004, 0.99, (0.0, 0.0)), LIMITS)[1]


# --- wiring ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("exchanged", EXCHANGES)
def test_every_exchange_is_told_before_anything_moves_far(elbow: Rig, exchanged: str) -> None:
    port = WiredPort(elbow, exchanged)
    reason = touch(port, elbow)
    findings = () if reason else start_up_check(port, elbow)
    assert reason or findings
    assert max(max(one.pressures) for one in port.truth) < 0.15 * elbow.muscles[0].max_pressure
    assert max(abs(one.position - port.truth[0].position) for one in port.truth) < 0.2
    if exchanged in EXCHANGES[2:]:
        assert "sign of its command is reversed" in reason
        assert max(max(one.pressures) for one in port.truth) < 2e4


def test_a_rightly_wired_robot_passes(elbow: Rig) -> None:
    port = WiredPort(elbow)
    assert touch(port, elbow) == ""
    assert start_up_check(port, elbow) == ()


@pytest.mark.parametrize("heavier", [1.0, 2.0, 3.0, 4.0, 6.0])
def test_a_free_joint_that_is_lighter_than_its_file_says_passes(elbow: Rig, heavier: float) -> None:
    """The driver's check with the file as it is takes such a joint for a wrong one."""
    joint = elbow.joints[0]
    written = elbow.with_joint(
        replace(joint, gravity_torque=0.0, inertia=heavier * joint.inertia, viscous_friction=0.05)
    )
    true = written.with_joint(replace(written.joints[0], inertia=0.7 * heavier * joint.inertia))
    for muscle in true.muscles:
        true = true.with_muscle(
            replace(muscle, turns=0.95 * muscle.turns, neutral_length=1.03 * muscle.neutral_length)
        )
    known = as_written(PartialRig(written), SAID, CalibrationRules())
    assert start_up_check(WiredPort(true), easily_turned(written, known, SAID)) == ()


def test_a_robot_that_is_not_empty_is_not_touched(elbow: Rig) -> None:
    port = WiredPort(elbow)
    for _ in range(100):
        port.advance((0.5, 0.5))
    sent = len(port.truth)
    assert "vent the robot first" in touch(port, elbow)
    assert len(port.truth) == sent + 1


# --- what is known, and what may be played --------------------------------------------------------


def test_intervals_are_those_of_the_file_then_those_of_the_motions(elbow: Rig) -> None:
    partial = PartialRig(
        elbow,
        {"elbow.inertia": (0.02, 0.1)},
        frozenset({"elbow.viscous_friction"}),
    )
    before = as_written(partial, SAID, CalibrationRules())
    by_key = {one.key: one for one in before}
    assert (by_key["elbow.inertia"].low, by_key["elbow.inertia"].high) == (0.02, 0.1)
    friction = by_key["elbow.viscous_friction"]
    assert friction.high / friction.low == pytest.approx(16.0)
    radius = by_key["elbow.pulley_radius"]
    assert radius.high / radius.value == pytest.approx(1.0 / 0.95)
    found = [
        CalibratedNumber("elbow.inertia", "kg m^2", "body", 0.05, 0.04, 0.03, 0.05, DETERMINED,
                         (0.039, 0.041)),
        CalibratedNumber("elbow.viscous_friction", "N m s/rad", "body", 0.05, 0.9, 0.8, 1.0, KEPT),
        CalibratedNumber("elbow.pulley_radius", "m", "statics", 0.03, 0.031, 0.029, 0.033,
                         DETERMINED),
    ]  # fmt: skip
    after = {one.key: one for one in narrowed(before, found)}
    assert (after["elbow.inertia"].low, after["elbow.inertia"].high) == (0.039, 0.041)
    assert after["elbow.viscous_friction"] == friction
    assert after["elbow.pulley_radius"].low == after["elbow.pulley_radius"].high == 0.031


def test_a_number_that_is_missing_is_not_known(elbow: Rig, tmp_path: Path) -> None:
    """A missing weight was taken for none, and the motions were planned without it."""
    tree = elbow.to_parameters()
    for section, keys in NUMBERS.items():
        for name, key in keys.items() if section in ("joint", "muscle", "valve") else ():
            if key.guess is not None:
                for owner in ("elbow", *elbow.muscle_names):
                    place = tree[owner].get("valve", {}) if section == "valve" else tree[owner]
                    place.pop(name, None)
    path = tmp_path / "rough.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}), encoding="utf-8")
    partial = load_partial_rig(path)
    known = {one.key: one for one in as_written(partial, SAID, CalibrationRules())}
    assert partial.missing <= known.keys()
    assert not {key for key, one in known.items() if not one.low < one.high}
    assert (known["elbow.gravity_torque"].low, known["elbow.gravity_torque"].high) == (
        0.0, pytest.approx(0.5 * 31.5, rel=0.05),
    )  # fmt: skip
    assert (known["elbow.gravity_angle"].low, known["elbow.gravity_angle"].high) == (-0.5, 0.5)


def test_a_joint_of_which_no_weight_is_written_is_planned_with_one(elbow: Rig) -> None:
    """Its muscles need more pressure then, and its motions may still be of full size."""
    used = []
    for missing in (frozenset[str](), frozenset({"elbow.gravity_torque"})):
        torque = 0.0 if missing else elbow.joints[0].gravity_torque
        rig = elbow.with_joint(replace(elbow.joints[0], gravity_torque=torque))
        known = as_written(PartialRig(rig, missing=missing), SAID, CalibrationRules())
        scale, limits = scale_of(rig, PERIOD), Limits.of(rig)
        motion = staircase(scale)
        robots = least_favourable(rig, known, motion, scale, limits)
        found = permitted(rig, robots, motion, scale, limits)
        assert found.share == 1.0
        used.append(found.worst.pressure)
    assert used[1] > used[0]


def test_in_the_design_every_number_is_at_both_ends_equally_often_and_independently(
    known: tuple[Known, ...],
) -> None:
    robots = design(known)[:-1]
    signs = np.array([[np.sign(r[one.name] - one.value) for one in known] for r in robots])
    assert np.all(signs.sum(axis=0) == 0)
    assert np.allclose(signs.T @ signs, len(robots) * np.eye(len(known)))


@pytest.fixture(scope="module")
def worst(elbow: Rig, known: tuple[Known, ...]) -> tuple[dict[str, float], ...]:
    scale = scale_of(elbow, 0.016)
    robots = least_favourable(elbow, known, steps(scale, "s", 1.0, 4.0, 1), scale, Limits.of(elbow))
    return tuple(dict(robot) for robot in robots)


def test_the_least_favourable_robot_is_worse_than_robots_in_between(
    elbow: Rig, known: tuple[Known, ...], worst: tuple[dict[str, float], ...]
) -> None:
    scale, limits = scale_of(elbow, 0.016), Limits.of(elbow)
    motion = steps(scale, "s", 1.0, 4.0, 1)
    most = np.max([foreseen(elbow, robot, motion, scale, limits, 0.016).all for robot in worst], 0)
    random = np.random.default_rng(5)
    for _ in range(12):
        robot = {one.name: float(random.uniform(one.low, one.high)) for one in known}
        found = foreseen(elbow, robot, motion, scale, limits, 0.016).all
        assert np.all(found <= 1.02 * most), (found, most)


def test_a_motion_is_made_smaller_until_the_least_favourable_robot_may_play_it(elbow: Rig) -> None:
    scale, limits = scale_of(elbow, PERIOD), Limits.of(elbow)
    motion = staircase(scale)

    def proportional(*given: object, **_: object) -> Foreseen:
        played = given[2]
        size = np.max(np.abs(played.position - scale.middle)) / scale.reach  # type: ignore[attr-defined]
        return Foreseen(0.5, 2.0 * PLANNED[1] * float(size) / 0.6, 0.5)

    allowed = permitted(elbow, [{}], motion, scale, limits, proportional)
    assert allowed.share == 0.45
    assert allowed.worst.is_permitted
    slow = permitted(
        elbow, [{}], motion, scale, limits,
        lambda *given: Foreseen(0.5, 0.6 * given[2].bandwidth / motion.bandwidth, 0.5),
    )  # fmt: skip
    assert (slow.share, slow.pace) == (1.0, 0.5)
    none = permitted(elbow, [{}], motion, scale, limits, lambda *_: Foreseen(2.0, 0.1, 0.1))
    assert none.share == 0.0


def test_a_motion_keeps_a_wrongly_described_joint_at_its_reference(elbow: Rig) -> None:
    """Lengths that are off by 5 % would turn the joint by half a radian at equal pressures."""
    flexor = elbow.muscle("elbow_flexor")
    true = elbow.with_muscle(
        replace(flexor, turns=1.05 * flexor.turns, thread_length=0.97 * flexor.thread_length)
    )
    scale, limits = scale_of(elbow, PERIOD), Limits.of(elbow)
    played = play(WiredPort(true), elbow, staircase(scale), scale, limits)
    assert not played.stopped
    position = played.table["joint_states.elbow.position"].to_numpy()
    wanted = staircase(scale).position
    ends = np.arange(1490, 5400, 500)  # shortly before the next stair
    assert np.abs(position[1 : wanted.size + 1][ends] - wanted[ends]).max() < 0.12
    pressures = played.table[["pressure_states.elbow_flexor", "pressure_states.elbow_extensor"]]
    assert pressures.iloc[-1].max() < 1e4


def test_a_motion_that_is_ended_lets_the_air_out_slowly(elbow: Rig) -> None:
    scale = scale_of(elbow, PERIOD)
    port = WiredPort(elbow)
    tight = replace(Limits.of(elbow), pressures=(0.08 * scale.highest,) * 2)
    played = play(port, elbow, filling(scale), scale, tight)
    assert "Pa" in played.stopped
    highest = np.array([max(one.pressures) for one in port.truth])
    end = int(np.argmax(highest))
    assert highest[end] < 0.09 * scale.highest
    assert highest[end + 250] > 0.5 * highest[end]  # 1 s later, of 3 s
    assert highest[-1] < 2e3


def test_in_a_lowering_the_muscle_with_the_faster_valve_waits_for_the_other_one(elbow: Rig) -> None:
    """Otherwise a joint that gravity does not hold would turn to its end."""
    free = elbow.with_joint(replace(elbow.joints[0], gravity_torque=0.0))
    slow = free.muscle("elbow_flexor")
    valve = replace(slow.valve, sonic_conductance=0.3 * slow.valve.sonic_conductance)
    true = free.with_muscle(replace(slow, valve=valve, dead_volume=2.0 * slow.dead_volume))
    scale, limits = scale_of(free, PERIOD), Limits.of(free)
    port = WiredPort(true)
    played = play(port, free, filling(scale), scale, limits)
    assert not played.stopped
    position = np.array([one.position for one in port.truth])
    pressures = np.array([one.pressures for one in port.truth])
    full = pressures.max(axis=1) > NEARLY_EMPTY
    assert np.abs(position[full]).max() < 0.35
    assert pressures[-1].max() < NEARLY_EMPTY


def test_at_a_signal_the_air_is_let_out_slowly(elbow: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    scale = scale_of(elbow, PERIOD)
    port = WiredPort(elbow)
    advance = port.advance

    def interrupted(commands: Sequence[float]) -> JointReading:
        reading = advance(commands)
        if len(port.truth) == 1200:
            raise KeyboardInterrupt
        return reading

    monkeypatch.setattr(port, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        play(port, elbow, filling(scale), scale, Limits.of(elbow))
    highest = [max(one.pressures) for one in port.truth]
    assert highest[1200] > 5e4
    assert highest[1325] > 0.5 * highest[1200]  # half a second later
    assert highest[-1] < NEARLY_EMPTY


def test_a_first_measurement_that_is_old_is_waited_for(
    elbow: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    scale, port = scale_of(elbow, PERIOD), WiredPort(elbow)
    advance = port.advance

    def late(commands: Sequence[float]) -> JointReading:
        reading = advance(commands)
        return reading._replace(position=math.nan) if len(port.truth) < 100 else reading

    monkeypatch.setattr(port, "advance", late)
    assert not play(port, elbow, filling(scale), scale, Limits.of(elbow)).stopped
    monkeypatch.setattr(
        port, "advance", lambda commands: advance(commands)._replace(position=math.nan)
    )
    assert "missing" in play(port, elbow, filling(scale), scale, Limits.of(elbow)).stopped


def test_a_robot_whose_driver_has_vented_is_no_still_robot(
    elbow: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    scale, port = scale_of(elbow, PERIOD), WiredPort(elbow)
    advance = port.advance
    monkeypatch.setattr(port, "advance", lambda _: advance((-1.0, -1.0)))
    played = play(port, elbow, staircase(scale), scale, Limits.of(elbow))
    assert "do not follow their commands" in played.stopped
    assert len(port.truth) * PERIOD < 8.0


# --- delays of a port -----------------------------------------------------------------------------


class LatePort(WiredPort):
    """A robot at the end of a bus: commands and readings take some periods."""

    def __init__(self, rig: Rig, commands: int, readings: int) -> None:
        super().__init__(rig)
        self.measurement_delay = readings * PERIOD
        self.command_delay += commands * PERIOD
        self._under_way: list[Sequence[float]] = [(-1.0, -1.0)] * commands
        self._readings = readings

    def advance(self, commands: Sequence[float]) -> JointReading:
        self._under_way.append(commands)
        now = super().advance(self._under_way.pop(0)).time
        return self.truth[max(len(self.truth) - 1 - self._readings, 0)]._replace(time=now)


@pytest.mark.parametrize(("commands", "readings"), [(0, 0), (2, 0), (0, 1), (2, 1)])
def test_a_recording_is_free_of_the_delays_of_its_port(
    elbow: Rig, commands: int, readings: int
) -> None:
    """Over ROS, 4 ms of delay would be identified as slow valves, and compensated twice."""
    scale, port = scale_of(elbow, PERIOD), LatePort(elbow, commands, readings)
    played = play(port, elbow, filling(scale), scale, Limits.of(elbow))
    assert not played.stopped
    again = WiredPort(elbow)
    sent = played.table[["valve_commands.elbow_flexor", "valve_commands.elbow_extensor"]]
    simulated = [again.advance(row).pressures for row in sent.to_numpy().tolist()]
    recorded = played.table[["pressure_states.elbow_flexor", "pressure_states.elbow_extensor"]]
    assert np.abs(np.array(simulated) - recorded.to_numpy()).max() < 1.0  # Pa


class StampedPort(WiredPort):
    """A robot whose messages come at times of their own: each is up to two periods old."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self._ages = np.random.default_rng(46)

    def advance(self, commands: Sequence[float]) -> JointReading:
        now = super().advance(commands)
        older = [int(self._ages.integers(0, 3)) for _ in range(2)]
        at, of = (self.truth[max(len(self.truth) - 1 - n, 0)] for n in older)
        return JointReading(
            now.time, at.position, of.pressures, "", now.time - at.time, now.time - of.time
        )


def test_a_recording_takes_measurements_at_their_stamps(elbow: Rig) -> None:
    """A mean age would leave half a period of jitter, which looks like noise of the sensors."""
    scale, port = scale_of(elbow, PERIOD), StampedPort(elbow)
    played = play(port, elbow, filling(scale), scale, Limits.of(elbow))
    assert not played.stopped
    table = played.table.iloc[:-2]  # a message that is on its way at the end is not known
    true = np.array([(one.position, *one.pressures) for one in port.truth])[: len(table)]
    shown = table[
        [
            "joint_states.elbow.position",
            "pressure_states.elbow_flexor",
            "pressure_states.elbow_extensor",
        ]
    ].to_numpy()
    speed = np.abs(np.diff(true, axis=0)).max(axis=0)  # per period
    assert (np.abs(shown - true).max(axis=0) <= 0.25 * speed).all()


def test_the_age_of_a_message_is_that_of_its_stamp() -> None:
    now = time.time()
    stamp = SimpleNamespace(sec=int(now - 0.02), nanosec=int(1e9 * ((now - 0.02) % 1.0)))
    assert age_of_stamp(stamp) == pytest.approx(0.02, abs=5e-3)
    assert age_of_stamp(SimpleNamespace(sec=int(now) + 60, nanosec=0)) == 0.0
    assert age_of_stamp(SimpleNamespace(sec=0, nanosec=0)) == 0.0


def test_a_tracking_test_plans_while_the_joint_rests_and_is_judged_at_the_time_of_its_readings(
    elbow: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over ROS, to plan at the start of the motion cost five commands and 20 mrad."""
    scale, port = scale_of(elbow, PERIOD), LatePort(elbow, 1, 1)
    controller = controller_for(port, elbow)
    follow, waits = controller.references.follow, []

    def noted(*given: Any, start: float, now: float) -> str:
        waits.append(start - now)
        return follow(*given, start=start, now=now)

    monkeypatch.setattr(controller.references, "follow", noted)
    points = reaches(scale.middle, scale.reach, 0.6)
    tracked = track(port, controller, points, Limits.of(elbow))
    assert not tracked.stopped
    assert min(waits) > 10 * PERIOD
    assert len(tracked.table) * PERIOD == pytest.approx(points[-1].time_from_start, abs=0.02)
    assert tracked.rms < 1e-3


def test_a_motion_that_takes_long_to_plan_is_followed_all_the_same(
    elbow: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the rough file of a drawn robot, to plan took 0.14 s: the test was ended each time."""
    scale, port = scale_of(elbow, PERIOD), SimulatedPort(elbow, PERIOD)
    controller, last = controller_for(port, elbow), [vented(elbow)]
    follow, advance = controller.references.follow, port.advance

    def remembered(commands: Sequence[float]) -> JointReading:
        last[0] = commands
        return advance(commands)

    def slow(*given: Any, **when: float) -> None:
        follow(*given, **when)
        for _ in range(round(0.2 / PERIOD)):
            advance(last[0])

    monkeypatch.setattr(port, "advance", remembered)
    monkeypatch.setattr(controller.references, "follow", slow)
    points = reaches(scale.middle, scale.reach, 0.6)
    tracked = track(port, controller, points, Limits.of(elbow))
    assert not tracked.stopped
    assert tracked.rms < 3e-3  # what is left of the pause when the motion begins


# --- a busy computer ------------------------------------------------------------------------------


class InterruptedPort(WiredPort):
    """A robot whose measurements are missing for a while, from one reading to another one."""

    def __init__(self, rig: Rig, exchanged: str, missing: range, refusal: str = "") -> None:
        super().__init__(rig, exchanged)
        self.missing, self.refusal = missing, refusal

    def advance(self, commands: Sequence[float]) -> JointReading:
        reading = super().advance(commands)
        if len(self.truth) not in self.missing:
            return reading
        unknown = reading._replace(position=math.nan, pressures=(math.nan, math.nan))
        return unknown._replace(refusal=self.refusal)


TOUCHING = 320  # readings
CHECKING = 900


@pytest.mark.parametrize("begin", range(1, TOUCHING, 20))
def test_a_measurement_that_is_missing_for_a_moment_accuses_no_valve(
    elbow: Rig, begin: int
) -> None:
    """Before, the valve that was touched filled the first muscle, which had no pressure at all."""
    assert touch(InterruptedPort(elbow, "", range(begin, begin + 9)), elbow) == ""


@pytest.mark.parametrize("begin", range(1, TOUCHING, 60))
def test_a_reversed_valve_is_told_although_a_measurement_was_missing(
    elbow: Rig, begin: int
) -> None:
    port = InterruptedPort(elbow, "sign of one valve", range(begin, begin + 9))
    assert "sign of its command is reversed" in touch(port, elbow)


@pytest.mark.parametrize("begin", range(1, CHECKING, 130))
def test_the_check_repeats_a_pulse_in_which_measurements_were_missing(
    elbow: Rig, begin: int
) -> None:
    missing = range(begin, begin + 40)
    assert start_up_check(InterruptedPort(elbow, "", missing), elbow) == ()
    (found, *_) = start_up_check(InterruptedPort(elbow, "hoses", missing), elbow)
    assert "crossed" in found.text or "exchanged" in found.text


def test_measurements_that_stay_away_are_the_reason(elbow: Rig) -> None:
    for begin in (1, 150):
        text = touch(InterruptedPort(elbow, "", range(begin, 10**6)), elbow)
        assert text == "A pressure or the angle is missing or too old."
        (found,) = start_up_check(InterruptedPort(elbow, "", range(begin, 10**6)), elbow)
        assert found.text == "a pressure or the angle is missing or too old"


def test_a_driver_that_takes_no_commands_is_the_reason(elbow: Rig) -> None:
    """It has vented, and then no valve seems to open."""
    why = "the driver is in fault (it stood still for 0.2 s)"
    for begin in (1, 150):
        assert why[1:] in touch(InterruptedPort(elbow, "", range(begin, 10**6), why), elbow)
        (found,) = start_up_check(InterruptedPort(elbow, "", range(begin, 10**6), why), elbow)
        assert found.text == why
    inactive = InterruptedPort(elbow, "", range(1, 10**6), why)
    assert "clear its faults and activate it" in touch(inactive, elbow)
    scale, limits = scale_of(elbow, PERIOD), Limits.of(elbow)
    port = InterruptedPort(elbow, "", range(200, 10**6), why)
    assert play(port, elbow, filling(scale), scale, limits).stopped == why


def test_a_valve_whose_zero_is_off_is_no_reversed_one(elbow: Rig) -> None:
    class LeakingPort(WiredPort):
        def advance(self, commands: Sequence[float]) -> JointReading:
            return super().advance((commands[0] + 0.03, commands[1]))

    text = touch(LeakingPort(elbow), elbow)
    assert text.startswith("elbow_flexor fills although its valve should be shut")


def test_a_single_wrong_reading_accuses_no_valve(elbow: Rig) -> None:
    class NoisyPort(WiredPort):
        def advance(self, commands: Sequence[float]) -> JointReading:
            time, position, pressures, *_ = super().advance(commands)
            outlier = 8e3 if len(self.truth) % 40 == 39 else 0.0
            return JointReading(time, position, (pressures[0], pressures[1] + outlier))

    assert touch(NoisyPort(elbow), elbow) == ""
