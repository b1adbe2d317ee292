"""What `pam gap record` writes, and what it says is missing."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pam_gap.live.message_intervals import MessageIntervals
from pam_gap.live.recording_advice import RecordingAdvice, progress_line
from pam_gap.rules import DEFAULT
from pam_model.rig import load_rig
from support.rigs import ELBOW

MUSCLES = ["elbow_flexor", "elbow_extensor"]


def watched(
    duration: float = 42.0,
    *,
    rest: float = 3.0,
    swing: float = 0.8,
    rate: float = 200.0,
    pressure: float = 1.5e5,
    topics: tuple[str, ...] = ("joint_states", "sent_valve_commands"),
) -> list[str]:
    """The advice after a recording that rests and then moves along a sine."""
    advice = RecordingAdvice(load_rig(ELBOW))
    for step in range(round(duration * rate)):
        time = step / rate
        moving = math.sin(3.0 * (time - rest)) if time > rest else 0.0
        if "joint_states" in topics:
            advice.take("joint_states", time, ["elbow"], [swing * moving])
        efforts = [2e5 + pressure * moving, 2e5 - pressure * moving]
        advice.take("pressure_states", time, MUSCLES, effort=efforts)
        if "sent_valve_commands" in topics:
            advice.take("sent_valve_commands", time)
    return advice.missing()


def test_the_line_of_a_complete_recording_does_not_call_anything_missing():
    assert progress_line(41.0, []) == (
        "41 s: nothing is missing any more; Ctrl-C ends the recording"
    )
    assert progress_line(3.0, ["a", "b"]) == "3 s, still missing: a; b"


def test_a_complete_recording_misses_nothing():
    assert watched() == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"duration": 12.0}, "length: 12 s of 40 s"),
        ({"rate": 50.0}, "pressure_states: arrives at 50 Hz, expected 200 Hz"),
        ({"swing": 0.1}, "excitation: elbow has used 10% of its range, expected 50%"),
        ({"pressure": 3e4}, "excitation: elbow_flexor has used 10% of its pressure"),
        ({"rest": 0.0}, "rest: elbow_extensor was not at rest for 2 s yet"),
        ({"topics": ("joint_states",)}, "sent_valve_commands or valve_commands: no message yet"),
        ({"topics": ("sent_valve_commands",)}, "joint_states: no message yet"),
    ],
)
def test_what_is_missing_is_said(change, said):
    found = watched(**change)
    assert any(line.startswith(said) for line in found), found


def test_a_controller_that_fell_silent_is_said():
    """The motion is over then, although the muscles have moved enough before."""
    advice = RecordingAdvice(load_rig(ELBOW))
    for tick in range(500):
        advice.take("pressure_states", 0.02 * tick, MUSCLES, effort=[1e5, 1e5])
        if tick < 250:
            advice.take("valve_commands", 0.02 * tick)
        elif tick == 340:
            assert not any("control:" in text for text in advice.missing())
    (said,) = [text for text in advice.missing() if text.startswith("control:")]
    assert "no valve_commands after 5 s; the driver may have vented" in said


def robot(
    duration: float = 60.0,
    *,
    keep=lambda time: True,
    sensed=lambda time, angle, pressures: (angle, pressures),
    late: float = 0.0,
) -> list[str]:
    """The advice after a motion with noise, of which some messages do not arrive."""
    random = np.random.default_rng(4)
    advice = RecordingAdvice(load_rig(ELBOW))
    for step in range(round(200.0 * duration)):
        time = step / 200.0
        if not keep(time):
            continue
        moving = math.sin(3.0 * (time - 3.0)) if time > 3.0 else 0.0
        noise = random.standard_normal(3)
        angle, pressures = sensed(
            time,
            0.8 * moving + 1e-4 * noise[0],
            [2e5 + 1.5e5 * moving + 100 * noise[1], 2e5 - 1.5e5 * moving + 100 * noise[2]],
        )
        arrival = time + late * random.random()
        advice.take("joint_states", arrival, ["elbow"], [angle], stamp=1e9 + time)
        advice.take("pressure_states", arrival, MUSCLES, effort=pressures, stamp=1e9 + time)
        advice.take("sent_valve_commands", arrival, stamp=1e9 + time)
    return advice.missing()


@pytest.mark.parametrize(("length", "share"), [(0.12, 0.45), (0.5, 0.45), (2.0, 0.2)])
def test_gaps_are_said_while_recording(length, share):
    """A mean rate shows no gaps: 45 % of the time in them was "missing: nothing"."""
    found = robot(keep=lambda time: time % (length / share) > length)
    (line,) = [line for line in found if line.startswith("gaps: ")]
    assert "has no joint_states (" in line
    assert "sent_valve_commands (" in line, "one line tells of all topics"
    if share > 0.4:
        assert any(line.startswith("length: ") and "without gaps" in line for line in found)


def test_a_motion_with_noise_and_late_arrivals_misses_nothing():
    assert robot() == []
    assert robot(late=0.08) == []


def test_lost_messages_are_said():
    random = np.random.default_rng(7)
    found = robot(keep=lambda time: random.random() > 0.15)
    (line,) = [line for line in found if line.startswith("lost: ")]
    assert all(f"{topic} (" in line for topic in ("joint_states", "pressure_states"))


@pytest.mark.parametrize(
    ("sensed", "said"),
    [
        (
            lambda time, angle, pressures: (0.31 if time > 20.0 else angle, pressures),
            "frozen: elbow's position",
        ),
        (
            lambda time, angle, pressures: (angle, [pressures[0], 1.7e5 if time > 20.0 else 2e5]),
            "frozen: elbow_extensor's pressure",
        ),
        (
            lambda time, angle, pressures: (angle, [min(p, 3e5) for p in pressures]),
            "clipped: elbow_flexor's pressure",
        ),
        (
            lambda time, angle, pressures: (max(angle, -0.6), pressures),
            "clipped: elbow's position",
        ),
    ],
)
def test_frozen_and_clipped_sensors_are_said(sensed, said):
    found = robot(sensed=sensed)
    assert any(line.startswith(said) for line in found), found


def test_a_clock_that_is_set_back_is_said():
    intervals = MessageIntervals(DEFAULT)
    for step in range(1000):
        intervals.take("joint_states", 0.005 * step - (1.0 if step > 500 else 0.0))
    (said,) = intervals.faults()
    assert said.startswith("clock: the stamps of joint_states ran backwards 1 times")


def test_before_the_first_message_the_topics_are_missing():
    assert RecordingAdvice(load_rig(ELBOW)).missing()[0].startswith("pressure_states: no message")


@pytest.mark.system
def test_the_bag_has_the_topics_of_one_robot_and_ctrl_c_ends_it(probe, ros_environment, tmp_path):
    from sensor_msgs.msg import JointState

    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "pam_gap", "record", "--rig", str(ELBOW), "--out", str(bag)]
    process = subprocess.Popen(
        [*command, "--namespace", "left"],
        env={**os.environ, **ros_environment},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        states = probe.publisher(JointState, "/left/pressure_states", 60.0)
        for number in range(20):
            states.publish(JointState(name=MUSCLES, effort=[1e5 + number, 2e5]))
        probe.publisher(JointState, "/left/joint_states", 60.0).publish(
            JointState(name=["elbow"], position=[0.25])
        )
        told = process.stdout.readline()
        while "still missing" not in told:
            assert told, "the recorder ended"
            told = process.stdout.readline()
        assert "sent_valve_commands or valve_commands: no message yet" in told
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert process.returncode == 0
    assert f"written: {bag}; missing: " in rest
    with AnyReader([Path(bag)]) as reader:
        found = [(c.topic, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    angles = [message for topic, message in found if topic == "/left/joint_states"]
    assert [message.position[0] for message in angles] == [0.25]
    assert sum(topic == "/left/pressure_states" for topic, _ in found) == 20
