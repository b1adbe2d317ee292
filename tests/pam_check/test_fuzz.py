"""A short turn of every fuzz target, what they have found, and that they can find something."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.logging import LoggingSeverity, get_logger

from pam_check.__main__ import main
from pam_check.fuzz import byte_targets as fuzz_bytes
from pam_check.fuzz import fuzz_run as fuzz
from pam_check.fuzz.random_targets import ViolationError
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_driver import driver as driver_module
from pam_driver.boards.pam_board.codec import BoardCodec, FrameError
from pam_driver.safety.states import SafetyEvent, SafetyState, next_state
from support.rigs import ELBOW

CODEC = BoardCodec.from_dbc()


@pytest.mark.parametrize("name", sorted(set(fuzz.TARGETS) - {"files"}))  # see test_damaged_files
def test_nothing_escapes(rig, name):
    assert fuzz.fuzz(rig, name, 1500, 1000) == {}


@settings(max_examples=500, deadline=None)
@given(st.integers(0, 2**11 - 1) | st.sampled_from([0x80, 0x100, 0x180, 0x280, 0x700]),
       st.binary(max_size=8))  # fmt: skip
def test_frames_decode_or_are_refused(identifier, data):
    try:
        board, message = CODEC.decode(identifier, data)
    except FrameError:
        return
    assert CODEC.encode(board, message)[0] == identifier


@pytest.mark.parametrize("velocity", [1e308, -1e308, 101.0])
def test_a_velocity_that_would_overflow_is_refused(velocity):
    references = ReferenceGenerator({"elbow": (-1.0, 1.0)})
    with pytest.raises(CommandError, match="rad/s"):
        references.stream(["elbow"], [0.0], [velocity], now=0.0)
    points = [TrajectoryPoint(0.1, [0.0], [velocity], []), TrajectoryPoint(0.2, [0.0], [0.0], [])]
    with pytest.raises(CommandError):
        references.follow(["elbow"], points, start=None, now=0.0)


def test_points_that_fall_together_far_away_are_refused():
    references = ReferenceGenerator({"elbow": (-1.0, 1.0)})
    points = [TrajectoryPoint(0.1, [0.0], [], []), TrajectoryPoint(0.1 + 1e-9, [0.5], [], [])]
    with pytest.raises(CommandError, match="too close"):
        references.follow(["elbow"], points, start=2.0**31, now=2.0**31)


def test_a_failure_is_found_kept_and_tried_again(monkeypatch, tmp_path, capsys):
    def broken(rig):
        def target(draw):
            if draw.random() < 1e-3:
                raise KeyError("on purpose")

        return target

    monkeypatch.setattr(fuzz, "TARGETS", {"broken": broken})
    arguments = [
        "fuzz",
        "all",
        "--check",
        "--rig",
        str(ELBOW),
        "--count",
        "5000",
        "--corpus",
        str(tmp_path),
    ]
    assert main(arguments) == 1
    assert json.loads((tmp_path / "broken.json").read_text())
    assert "on purpose" in capsys.readouterr().err
    assert main([*arguments, "--seed", "900000"]) == 1


# --- bytes, and what a coverage-guided fuzzer has kept of them (tools/fuzz.sh) -------------------

CORPUS = Path(__file__).parents[1] / "data/fuzz_corpus"


def kept(name: str) -> list[bytes]:
    return [bytes.fromhex(line) for line in (CORPUS / f"{name}.txt").read_text().split()]


@pytest.mark.parametrize("name", sorted(set(fuzz_bytes.TARGETS) - {"driver"}))
def test_the_kept_inputs_do_no_harm(name):
    inputs = kept(name)
    assert len(inputs) > 20
    for data in inputs:
        fuzz_bytes.TARGETS[name](data)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=200))
def test_bytes_do_no_harm(data):
    for target in fuzz_bytes.TARGETS.values():
        target(data)


def test_the_kept_inputs_do_no_harm_to_a_driver_and_reach_each_of_its_states(monkeypatch):
    inputs, reached = kept("driver"), set()
    assert len(inputs) > 20
    act = fuzz_bytes.Driver.cycle

    def cycle(self, now, wall_now):
        snapshot = act(self, now, wall_now)
        reached.add(snapshot.state)
        return snapshot

    monkeypatch.setattr(fuzz_bytes.Driver, "cycle", cycle)
    for data in inputs:
        fuzz_bytes.TARGETS["driver"](data)
    # the start-up check is off here, and no input keeps a board well while commands time out
    not_here = {SafetyState.UNCONFIGURED, SafetyState.CHECKING, SafetyState.FAULT_LOWERING}
    assert reached == set(SafetyState) - not_here


def no_faults(state, event):
    return state if event is SafetyEvent.FAULT else next_state(state, event)


def no_latch(state, event):
    latched = state is SafetyState.FAULT and event is SafetyEvent.ACTIVATE
    return SafetyState.READY if latched else next_state(state, event)


def test_the_kept_inputs_would_find_a_driver_that_does_not_stop(monkeypatch):
    monkeypatch.setattr(driver_module, "next_state", no_faults)
    with pytest.raises(ViolationError, match="without a fresh command"):
        for data in kept("driver"):
            fuzz_bytes.driver(data)


def test_a_refused_activation_is_watched(monkeypatch):
    monkeypatch.setattr(driver_module, "next_state", no_latch)
    monkeypatch.setattr(driver_module.Driver, "_activation_problem", lambda self, now: "")
    with pytest.raises(ViolationError):
        for data in kept("driver"):
            fuzz_bytes.driver(data)


# --- the nodes themselves -----------------------------------------------------------------------


def test_nothing_escapes_the_callbacks_of_the_nodes(capfd):
    assert (
        main(["fuzz-callbacks", "--check", "--rig", str(ELBOW), "--count", "1000", "--seed", "7"])
        == 0
    )
    told = capfd.readouterr().out
    assert "pam_driver /valve_commands: 1000 messages, 0 blocks failed" in told
    for topic in ("joint_trajectory", "commands", "stiffness_commands", "torque_commands"):
        assert f"/pam_controller/{topic}: 1000 messages" in told
    assert "pam_rig /pam_rig/inject_fault: 1000 messages" in told
    # a level outlives its node: later nodes of this process must still be heard
    assert get_logger("pam_driver").get_effective_level() < LoggingSeverity.WARN
