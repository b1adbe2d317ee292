"""The gap of the last seconds, and the node that reports it, as a process over ROS."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pam_check.faults.campaign import make_chain
from pam_gap.live.live_gap import LiveWindow
from pam_gap.recordings.recording import COMMANDS, JOINTS, PRESSURES
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import load_rig
from support.mixed_rig import TWO_JOINTS, drive

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
MUSCLES = ["elbow_flexor", "elbow_extensor"]
PERIOD = 0.005


class Rig:
    """A plant under a simple pressure loop, with noisy sensors."""

    def __init__(self, changes: dict[str, float]) -> None:
        parameters = PlantParameters.from_rig(load_rig(ELBOW)).replaced(changes)
        self.plant = Plant(parameters, state=initial_state(parameters, pressures=(2.4e5, 2.4e5)))
        self.seen = (0.0, 2.4e5, 2.4e5)
        self.time = 0.0
        self.noise = np.random.default_rng(3)

    def step(self) -> tuple[tuple[float, float], tuple[float, float, float]]:
        """Commands, and what was measured when they were given: position and pressures."""
        swing = 6e4 * math.sin(2.0 * math.pi * 0.7 * self.time)
        wanted = (2.4e5 + swing, 2.4e5 - swing)
        first, second = (
            min(max(6e-6 * (w - p), -1.0), 1.0) for w, p in zip(wanted, self.seen[1:], strict=True)
        )
        seen, self.seen = self.seen, self.plant.step((first, second), PERIOD)
        self.time += PERIOD
        q, a, b = np.array(seen) + self.noise.standard_normal(3) * (2e-4, 150.0, 150.0)
        return (first, second), (float(q), float(a), float(b))


def watched(changes: dict[str, float], with_commands: bool = True) -> Any:
    rig, window = Rig(changes), LiveWindow(load_rig(ELBOW), 5.0)
    for _ in range(1200):
        at = rig.time
        commands, (q, a, b) = rig.step()
        if with_commands:
            window.take(COMMANDS, at, MUSCLES, commands)
        window.take(PRESSURES, at, MUSCLES[::-1], (b, a))
        window.take(JOINTS, at, ["elbow", "stranger"], (q, 1.0))
    return window.gap(0)


def test_the_rig_as_written_is_near_its_noise() -> None:
    gap = watched({})
    assert not gap.problem
    assert gap.worst < 2.0
    channels = {f.channel for f in gap.figures}
    assert channels == {
        "pressure_states.elbow_flexor",
        "pressure_states.elbow_extensor",
        "joint_states.elbow.position",
    }


@pytest.mark.parametrize(
    ("effect", "stage"),
    [
        ({"leakage.conductance": 3e-10}, "valve"),
        ({"payload.mass": 0.6, "payload.distance": 0.3}, "muscle and joint"),
    ],
)
def test_a_hidden_effect_shows_at_its_stage(effect: dict[str, float], stage: str) -> None:
    gap = watched(effect)
    assert gap.worst > 5.0
    assert gap.stage == stage


def test_without_commands_the_valve_stage_is_not_judged() -> None:
    gap = watched({}, with_commands=False)
    assert "valve" not in (gap.stages or {})


def test_what_is_missing_is_said() -> None:
    window = LiveWindow(load_rig(ELBOW), 5.0)
    assert "pressure_states.elbow_flexor" in window.gap(0).problem
    for at in (0.0, 0.5):
        window.take(PRESSURES, at, MUSCLES, (1e5, 1e5))
    assert "0.5 s" in window.gap(0).problem
    window.take(JOINTS, 10.0, ["elbow"], (0.0,))
    assert "no pressure_states" in window.gap(0).problem


def test_a_wild_stamp_is_a_problem_and_passes() -> None:
    """Of a broken clock; kept apart, it would span a grid larger than any memory."""
    window = LiveWindow(load_rig(ELBOW), 5.0)
    for at in [*(np.arange(1000) * PERIOD).tolist(), 1e12, *(np.arange(4) * PERIOD).tolist()]:
        window.take(PRESSURES, at, MUSCLES, (2e5 + at, 2e5))
    assert "received so far" in window.gap(0).problem


@pytest.mark.parametrize("wild", [1e308, -1e308, math.inf, math.nan])
def test_a_wild_value_is_missing_and_no_error(wild: float) -> None:
    rig, window = Rig({}), LiveWindow(load_rig(ELBOW), 5.0)
    for k in range(2000):
        commands, (q, a, b) = rig.step()
        window.take(COMMANDS, rig.time, MUSCLES, commands)
        window.take(PRESSURES, rig.time, MUSCLES, (wild if k % 500 == 7 else a, b))
        window.take(JOINTS, rig.time, ["elbow"], (wild if k % 500 == 9 else q,))
    gap = window.gap(0)
    assert gap.figures, gap.problem
    assert all(math.isfinite(one.error) for one in gap.figures), gap


@pytest.mark.system
def test_a_signal_ends_the_node_while_its_first_report_compiles_the_simulation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("rclpy")
    from pam_gap.live.monitor_node import main

    begun: list[float] = []

    def compiled(window: LiveWindow, joint: int) -> None:
        begun.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)
        while time.monotonic() < begun[0] + 30.0:
            time.sleep(0.01)

    monkeypatch.setattr(LiveWindow, "gap", compiled)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        assert main(["--ros-args", "--params-file", str(ELBOW), "-p", "period:=0.5"]) == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert time.monotonic() < begun[0] + 15.0


@pytest.mark.system
def test_node_reports_on_diagnostics(
    probe: Any, ros_environment: dict[str, str], patience: float
) -> None:
    from builtin_interfaces.msg import Time
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
    from sensor_msgs.msg import JointState

    heard = probe.listen(DiagnosticArray, "/diagnostics")
    node = subprocess.Popen(
        [sys.executable, "-m", "pam_gap", "monitor", "--ros-args", "--params-file", str(ELBOW),
         "-p", "window:=3.0", "-p", "period:=0.5"],
        env=os.environ | ros_environment | {"NUMBA_NUM_THREADS": "1"},
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip

    def told(level: bytes) -> bool:
        return bool(heard) and heard[-1].status[0].level == level

    try:
        out = {
            topic: probe.publisher(JointState, topic, 30.0 * patience)
            for topic in ("valve_commands", "pressure_states", "joint_states")
        }
        probe.wait_for("a report", lambda: told(DiagnosticStatus.STALE), 20.0 * patience)
        for changes, level in (
            ({}, DiagnosticStatus.OK),
            ({"payload.mass": 1.0, "payload.distance": 0.3}, DiagnosticStatus.WARN),
        ):
            rig = Rig(changes)
            begin = time.time()
            while not told(level):
                assert rig.time < 40.0 * patience, heard[-1].status[0]
                whole, part = divmod(begin + rig.time, 1.0)
                stamp = Time(sec=int(whole), nanosec=int(part * 1e9))
                commands, (q, a, b) = rig.step()
                for topic, message in (
                    ("valve_commands", JointState(name=MUSCLES, position=commands)),
                    ("pressure_states", JointState(name=MUSCLES, effort=(a, b))),
                    ("joint_states", JointState(name=["elbow"], position=(q,))),
                ):
                    message.header.stamp = stamp
                    out[topic].publish(message)
                time.sleep(max(begin + rig.time - time.time(), 0.0))
        status = heard[-1].status[0]
        assert status.name == "pam_gap: elbow"
        keys = {pair.key for pair in status.values}
        assert "joint_states.elbow.position 0.5 s [rad]" in keys
        assert "times the noise" in status.message
    finally:
        node.send_signal(signal.SIGINT)
        _, errors = node.communicate(timeout=20.0 * patience)
    assert node.returncode == 0, errors


@pytest.mark.long("test_mixed_rig watches both kinds without the node")
@pytest.mark.system
def test_node_watches_the_valves_of_both_kinds(
    probe: Any, ros_environment: dict[str, str], patience: float
) -> None:
    from builtin_interfaces.msg import Time
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import JointState

    messages = drive(make_chain(load_rig(TWO_JOINTS)), 4.0)
    heard = probe.listen(DiagnosticArray, "/diagnostics")
    node = subprocess.Popen(
        [sys.executable, "-m", "pam_gap", "monitor", "--ros-args", "--params-file",
         str(TWO_JOINTS), "-p", "window:=3.0", "-p", "period:=0.5"],
        env=os.environ | ros_environment | {"NUMBA_NUM_THREADS": "1"},
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip

    def ratios() -> dict[str, float]:
        return {
            status.name: float(pair.value)
            for status in (heard[-1].status if heard else ())
            for pair in status.values
            if pair.key == "stage valve [times the noise]"
        }

    try:
        out = {
            topic: probe.publisher(JointState, topic, 30.0 * patience)
            for topic in ("valve_commands", "pressure_states", "joint_states")
        }
        begin = time.time() - messages[0].time
        for entry in messages:
            whole, part = divmod(begin + entry.time, 1.0)
            for topic, (name, position, velocity, effort) in entry.topics.items():
                message = JointState(name=name, position=position, velocity=velocity, effort=effort)
                message.header.stamp = Time(sec=int(whole), nanosec=int(part * 1e9))
                out[topic.removeprefix("sent_")].publish(message)
            time.sleep(max(begin + entry.time - time.time(), 0.0))
        probe.wait_for("the gap of both joints", lambda: len(ratios()) == 2, 30.0 * patience)
        assert all(math.isfinite(ratio) for ratio in ratios().values())
    finally:
        node.send_signal(signal.SIGINT)
        _, errors = node.communicate(timeout=20.0 * patience)
    assert node.returncode == 0, errors
