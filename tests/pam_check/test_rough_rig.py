"""The rough rig of `pam_check rough-rig`: what is hidden, how laws are compared, the picture."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from pam_check.__main__ import main
from pam_check.control.closed_loop import TOLD, play, true_rig
from pam_check.control.motions import MOTIONS
from pam_check.control.rough_control import Baselines
from pam_check.control.rough_rig import RoughRig, problems, rough_truth
from pam_check.control.rough_rig_picture import Way, draw
from pam_control.controller import Controller
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"


def way(name: str, error: float, stopped: str = "") -> Way:
    reference = np.linspace(0.0, 1.0, 50)
    return Way(name, reference - error, reference, stopped)


def test_the_rough_rig_is_another_rig_in_all_that_it_claims():
    joint, muscles = true_rig(load_rig(ELBOW))
    rough, rough_muscles = rough_truth(load_rig(ELBOW))
    assert rough.pulley_radius == pytest.approx(1.02 * joint.pulley_radius)
    assert rough.coulomb_torque > joint.coulomb_torque
    for clean, real in zip(muscles, rough_muscles, strict=True):
        assert real.turns == pytest.approx(0.98 * clean.turns)
        assert real.command_delay == pytest.approx(clean.command_delay + 0.01)
        assert real.thread_friction > clean.thread_friction


CLEAN = [way("pid", 2e-3), way("controller", 1e-3)]


def test_a_law_that_is_worse_than_the_one_before_it_is_named():
    assert problems(CLEAN, [way("pid", 4e-3), way("a", 3e-3), way("b", 1e-3)]) == []
    (found,) = problems(CLEAN, [way("pid", 4e-3), way("a", 3e-3), way("b", 3.5e-3)])
    assert "b: 3.50 mrad, where a has 3.00 mrad" in found
    (found,) = problems(CLEAN[::-1], [way("pid", 4e-3), way("a", 3e-3)])
    assert "pid: 2.00 mrad, where controller has 1.00 mrad" in found


def test_only_with_what_was_diagnosed_a_law_has_to_beat_the_pid_of_the_rough_rig():
    """The PID was tuned in the motion that the controller plays for the first time."""
    pid, before = way("pid", 4e-3), way("before", 6e-3)
    assert problems(CLEAN, [pid, before, way("after", 3e-3)]) == []
    (found,) = problems(CLEAN, [pid, before, way("after", 5e-3)])
    assert "after: 5.00 mrad, where pid has 4.00 mrad" in found


def test_a_law_that_stopped_is_worse_than_any_that_did_not():
    stopped = way("controller", 1e-3, "loop_too_slow")
    assert math.isinf(stopped.rms)
    assert len(problems([way("pid", 0.1), stopped], CLEAN)) == 1


def test_the_motion_that_is_learnt_is_compared_with_the_same_reference(tmp_path):
    """It begins later, because its way to the start is a part of it."""
    pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")
    rig = load_rig(ELBOW)
    bench = RoughRig(rig, 3, Baselines(tmp_path / "tuned.json"), 1)
    once = bench.controller("once", rig, *true_rig(rig))
    learnt = bench.repeated(rig, *true_rig(rig), 2)
    assert once.reference.size == learnt.reference.size
    assert np.abs(once.reference - learnt.reference).max() < 5e-3
    assert once.rms < 1e-3
    assert learnt.rms < 1e-3
    points = MOTIONS["arm"](np.random.default_rng([3, 0]))
    law = Controller(rig, TOLD)
    played, _ = play(law, *true_rig(rig), points, 103)
    assert once.rms == pytest.approx(played.rms, rel=1e-6)


@pytest.mark.long("the rig, the laws and the picture are held alone; this is their command")
def test_without_an_improved_rig_file_the_rest_is_shown_and_the_command_says_so(
    tmp_path, monkeypatch, capsys
):
    pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")
    unknown = SimpleNamespace(improved=None, sentence="Nothing explains it.", to_json=dict)
    monkeypatch.setattr(RoughRig, "diagnosis", lambda *_: unknown)
    # the search for better gains is held in test_rough_control
    monkeypatch.setattr("pam_check.control.rough_control.tune", lambda bench, *_: bench.first())
    given = ["rough-rig", "--tries", "1", "--repetitions", "2", "--out", str(tmp_path)]
    given += ["--tuned", str(tmp_path / "tuned.json"), "--json", "--check"]
    assert main(given) == 1
    shown = capsys.readouterr()
    assert "the diagnosis has written no improved rig file" in shown.err
    laws = json.loads(shown.out)["rms"]
    assert [len(each) for each in laws.values()] == [2, 3]
    assert all(0.0 < rms < 0.1 for each in laws.values() for rms in each.values())
    assert (tmp_path / "rough_rig.png").stat().st_size > 10_000


def test_a_law_that_stopped_has_no_error_in_the_picture(tmp_path, monkeypatch):
    drawn: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    draw(tmp_path / "rough_rig.png", {"rough": [way("pid", 2e-3), way("a", 1e-3, "too slow")]})
    labels = drawn[0].axes[1].get_legend_handles_labels()[1]
    assert labels == ["pid: 2.00 mrad RMS", "a: stopped (too slow)"]


def test_the_picture_shows_every_law_in_its_colour(tmp_path):
    path = tmp_path / "rough_rig.png"
    clean = [way("pid", 2e-3), way("controller", 1e-3)]
    draw(path, {"clean": clean, "rough": [way("pid", 4e-3), way("a", 3e-3), way("b", 1e-3)]})
    pixels = (255 * matplotlib.image.imread(path)[..., :3]).round().astype(int).reshape(-1, 3)
    shown = {"#{:02x}{:02x}{:02x}".format(*pixel) for pixel in pixels.tolist()}
    assert {"#8e5bb5", "#d9822b", "#1f5fbf", "#1a7f4b"} <= shown
