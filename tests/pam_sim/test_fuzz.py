"""A short turn of every fuzz target, what they have found, and that they can find something."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pam_control.reference_generator import ReferenceGenerator
from pam_control.trajectory import CommandError, TrajectoryPoint
from pam_driver.codec import BoardCodec, FrameError
from pam_sim import fuzz

from .conftest import ELBOW

CODEC = BoardCodec.from_dbc()


@pytest.mark.parametrize("name", fuzz.TARGETS)
def test_nothing_escapes(rig, name):
    assert fuzz.fuzz(rig, name, 3000, 1000) == {}


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
        references.follow(["elbow"], points, start=2.0**31, now=0.0)


def test_a_failure_is_found_kept_and_tried_again(monkeypatch, tmp_path, capsys):
    def broken(rig):
        def target(draw):
            if draw.random() < 1e-3:
                raise KeyError("on purpose")

        return target

    monkeypatch.setattr(fuzz, "TARGETS", {"broken": broken})
    arguments = ["all", "--rig", str(ELBOW), "--count", "5000", "--corpus", str(tmp_path)]
    assert fuzz.main(arguments) == 1
    assert json.loads((tmp_path / "broken.json").read_text())
    assert "on purpose" in capsys.readouterr().err
    assert fuzz.main([*arguments, "--seed", "900000"]) == 1
