"""The sequence of a commissioning: it ends where something does not fit, goes on, and it tracks."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

import pam_demo.commission.sequence as sequence_module
from pam_demo.__main__ import main
from pam_demo.commission.commission import run, to_document, write_results
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.kept import Kept
from pam_demo.commission.lower_priority import NICENESS, at_lower_priority
from pam_demo.commission.page import render
from pam_demo.commission.sequence import Commissioning, EndedError
from pam_demo.commission.tracking import Tracked, reaches
from pam_gap.calibration.calibration import Calibration
from pam_gap.calibration.free_numbers import Said
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_model.rig.partial import load_partial_rig
from support.commission_ports import EXCHANGES, PERIOD, WiredPort

ROOT = Path(__file__).parents[2]
ELBOW = ROOT / "config" / "elbow.yaml"
SAID = Said(1.0 / 3.0, 0.05)
OFF = {
    "elbow.inertia": 1.25, "elbow.viscous_friction": 0.75, "elbow.gravity_torque": 0.8,
    "elbow.pulley_radius": 1.03, "elbow_flexor.thread_length": 0.98,
    "elbow_extensor.turns": 1.03, "elbow_flexor.valve.sonic_conductance": 0.75,
    "elbow_extensor.valve.sonic_conductance": 0.8, "elbow_extensor.dead_volume": 1.3,
}  # fmt: skip
"""Factors of the rough rig file."""


@pytest.fixture(scope="module")
def elbow() -> Rig:
    return load_rig(ELBOW)


@pytest.fixture
def rough(tmp_path: Path) -> Path:
    """A rig file of the elbow whose numbers are off."""
    tree = yaml.safe_load(ELBOW.read_text())
    parameters = tree["/**"]["ros__parameters"]
    for key, factor in OFF.items():
        *path, last = key.split(".")
        branch = parameters
        for step in path:
            branch = branch[step]
        branch[last] *= factor
    path_of = tmp_path / "rough.yaml"
    path_of.write_text(yaml.safe_dump(tree))
    return path_of


@pytest.fixture
def begin(rough: Path, tmp_path: Path) -> Callable[..., tuple[Commissioned, list[str]]]:
    """Commission a port up to the first step whose words contain a text."""
    partial = load_partial_rig(rough)
    said: list[str] = []

    def run(port: WiredPort, refused: str = "") -> tuple[Commissioned, list[str]]:
        said.clear()
        kept = Kept(tmp_path / "out", rough.read_text())

        def ask(what: str) -> bool:
            return not (refused and refused in what)

        return Commissioning(port, partial, SAID, kept, said.append, ask).run(), list(said)

    return run


@pytest.fixture
def quick_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """The most likely robot in place of the search for the least favourable one."""
    monkeypatch.setattr(
        sequence_module,
        "least_favourable",
        lambda _rig, known, *_: ({one.name: one.value for one in known},),
    )


@pytest.mark.parametrize("exchanged", EXCHANGES)
def test_an_exchange_ends_it_before_the_first_motion(
    elbow: Rig, begin: Callable[..., Any], exchanged: str
) -> None:
    done, _ = begin(WiredPort(elbow, exchanged))
    assert done.ended
    assert done.rig is None
    assert not done.steps


@pytest.mark.usefixtures("quick_limits")
def test_after_an_interruption_it_goes_on_behind_the_last_recording(
    elbow: Rig, begin: Callable[..., Any], rough: Path
) -> None:
    first, said = begin(WiredPort(elbow), refused="small steps of the angle")
    assert "not agreed to" in first.ended
    assert [step.motion for step in first.steps] == ["filling"]
    port = WiredPort(elbow)
    second, said = begin(port, refused="small steps of the angle")
    assert "start-up check: passed before" in said
    assert "filling: recorded before" in said
    assert not second.steps
    assert not port.truth
    rough.write_text(rough.read_text() + "\n# another\n")
    third, said = begin(WiredPort(elbow), refused="small steps of the angle")
    assert [step.motion for step in third.steps] == ["filling"]


def test_numbers_with_which_nothing_is_planned_any_more_are_not_identified(
    elbow: Rig,
    begin: Callable[..., Any],
    rough: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = pd.DataFrame({"time": [0.0, PERIOD]})
    kept = Kept(tmp_path / "out", rough.read_text())
    kept.check()
    for name in ("filling", "staircase", "steps"):
        kept.add(name, table)
    fitted: list[list[str]] = []

    def refused(
        _rig: object, _joint: int, recordings: list[object], *_: object, **__: object
    ) -> Any:
        fitted.append(list(map(str, recordings)))
        return Calibration("elbow", numbers=(object(),), refused=("Enough.",))  # type: ignore[arg-type]

    monkeypatch.setattr(sequence_module, "calibrate_joint", refused)
    monkeypatch.setattr(sequence_module, "as_recording", lambda _table, name, _step: name)
    done, _ = begin(WiredPort(elbow))
    assert done.ended == "Enough."
    assert fitted == [["staircase", "steps"]]


@pytest.mark.usefixtures("quick_limits")
def test_a_joint_that_is_faster_than_any_robot_within_the_intervals_does_not_fit(
    elbow: Rig, begin: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    port = WiredPort(elbow)
    advance, turned = port.advance, [0.0]

    def kicked(commands: Any) -> Any:
        reading = advance(commands)
        if min(reading.pressures) > 3e4:  # in the filling, and not in the start-up check
            turned[0] = min(turned[0] + 2.0 * PERIOD, 0.5)
        return reading._replace(position=reading.position + turned[0])

    monkeypatch.setattr(port, "advance", kicked)
    done, _ = begin(port)
    assert "filling: the joint moves with" in done.ended
    assert "let out slowly" in done.ended


@pytest.mark.usefixtures("quick_limits")
def test_motions_that_no_numbers_explain_end_it(
    elbow: Rig, begin: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> Calibration:
        return Calibration("elbow", numbers=(object(),), refused=("Nothing explains it.",))  # type: ignore[arg-type]

    monkeypatch.setattr(sequence_module, "calibrate_joint", refused)
    done, _ = begin(WiredPort(elbow))
    assert done.ended == "Nothing explains it."
    assert [step.motion for step in done.steps] == ["filling", "staircase"]


def test_the_tracking_motion_begins_and_ends_at_rest_within_its_reach() -> None:
    points = reaches(0.1, 0.6, 0.8)
    assert points[-1].positions == [0.1]
    assert list(points[-1].velocities) == [0.0]
    assert max(abs(point.positions[0] - 0.1) for point in points) == pytest.approx(0.36)
    times = [point.time_from_start for point in points]
    assert times == sorted(times)


def test_an_ended_commissioning_is_a_page_and_no_rig_file(rough: Path, tmp_path: Path) -> None:
    done = Commissioned(ended="the sign of <b>it</b> is reversed")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "commissioned.yaml").write_text("# of an earlier commissioning")
    write_results(load_partial_rig(rough), "elbow", done, tmp_path / "out", SAID)
    assert not (tmp_path / "out" / "commissioned.yaml").exists()
    assert "earlier" in (tmp_path / "out" / "commissioned_earlier.yaml").read_text()
    assert json.loads((tmp_path / "out" / "commission.json").read_text()) == to_document(
        "elbow", done
    )
    assert "the sign of &lt;b&gt;it" in render("elbow", done)


def test_it_asks_and_a_script_has_to_say_yes(
    rough: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["commission", "--rig", str(rough), "--simulate", str(ELBOW), "--out", str(tmp_path)]
    assert main(given) != 0
    assert "--yes" in capsys.readouterr().err


def test_a_joint_that_the_rig_does_not_have_is_refused(
    rough: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["commission", "--rig", str(rough), "--simulate", str(ELBOW), "--out", str(tmp_path),
             "--joint", "wrist", "--yes"]  # fmt: skip
    assert main(given) != 0
    assert "wrist" in capsys.readouterr().err


def test_a_simulated_robot_may_have_its_hoses_crossed(
    rough: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """So that its owner can try what the command says of it."""
    given = ["commission", "--rig", str(rough), "--out", str(tmp_path / "out"), "--yes"]
    assert main([*given, "--crossed-hoses"]) == 2
    assert "expected --simulate" in capsys.readouterr().err
    assert main([*given, "--simulate", str(ELBOW), "--crossed-hoses", "--check"]) == 1
    answer = json.loads((tmp_path / "out" / "commission.json").read_text())
    assert answer["ended"].startswith("Start-up check: ")
    assert not answer["steps"]


def test_the_page_says_that_a_slower_reference_is_another_one(elbow: Rig) -> None:
    def tracked(speed: float) -> Tracked:
        time = np.arange(0.0, 1.0, 0.01)
        table = pd.DataFrame({"time": time, "reference": speed * time, "position": speed * time})
        return Tracked(1e-3, 2e-3, "", table)

    done = Commissioned(rig=elbow, before=tracked(0.5), after=tracked(1.0))
    assert "up to 0.49 rad apart" in render("elbow", done)
    assert "apart" not in render("elbow", replace(done, before=tracked(1.0)))


@pytest.mark.long("the campaign of pam_check and the steps above stand for the whole sequence")
def test_a_rough_elbow_tracks_in_the_end(rough: Path, tmp_path: Path, elbow: Rig) -> None:
    out = tmp_path / "out"
    given = ["commission", "--rig", str(rough), "--simulate", str(ELBOW), "--out", str(out),
             "--yes"]  # fmt: skip
    assert main(given) == 0
    answer = json.loads((out / "commission.json").read_text())
    assert answer["tracking"]["after"]["rms"] < 3e-3
    found = load_rig(out / "commissioned.yaml")
    ratio = found.joints[0].inertia / elbow.joints[0].inertia
    assert ratio == pytest.approx(1.0, rel=0.1)
    assert answer["gains"]
    assert 0.0 < answer["steps"][-1]["most"]["speed"] < 1.0
    assert found.parameter_tolerance > load_rig(ELBOW).parameter_tolerance
    assert "Commissioned" in (out / "commission.html").read_text()


@pytest.mark.usefixtures("quick_limits")
def test_recordings_of_one_robot_do_not_pass_for_those_of_another(
    rough: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As when it is tried on a simulated robot first, and then started on the real one."""
    out = tmp_path / "out"
    opened: list[str] = []

    @contextmanager
    def open_port(*given: Any) -> Iterator[WiredPort]:
        opened.append(given[1])
        yield WiredPort(load_rig(ELBOW))

    def ask(what: str) -> bool:
        return "small steps" not in what

    given = argparse.Namespace(
        rig=rough, out=out, joint="", namespace="", rate=250.0, tolerance=0.3,
        length_tolerance=0.05, simulate=ELBOW, yes=True, crossed_hoses=False,
    )  # fmt: skip
    for number, simulate in enumerate((ELBOW, ELBOW, None)):
        given.simulate = simulate
        with pytest.MonkeyPatch.context() as patch:  # `yes` allows all, so that is what is changed
            patch.setattr(Commissioning, "_allowed", lambda self, what: _refused(self, what, ask))
            run(given, open_port)
        text = capsys.readouterr().out
        assert ("filling: recorded before" in text) == (number == 1)
    assert opened == ["elbow"]


def _refused(self: Commissioning, what: str, ask: Callable[[str], bool]) -> None:
    if not ask(what):
        raise EndedError(f"not allowed: {what}")


def test_what_computes_has_a_lower_priority_and_what_moves_keeps_its_own() -> None:
    before = os.nice(0)
    assert at_lower_priority(lambda: os.nice(0)) == min(before + NICENESS, 19)
    assert os.nice(0) == before

    def fails() -> None:
        raise PamError("no numbers")

    with pytest.raises(PamError, match="no numbers"):
        at_lower_priority(fails)


class PausingPort(WiredPort):
    """A robot whose computer stands still for 0.3 s at some readings of one motion."""

    def __init__(self, rig: Rig, pauses: tuple[int, ...]) -> None:
        super().__init__(rig)
        self.pauses, self.late = pauses, 0.0

    def advance(self, commands: Any) -> Any:
        reading = super().advance(commands)
        if len(self.truth) in self.pauses:
            self.late += 0.3
        return reading._replace(time=reading.time + self.late)


FILLING = 1400
"""A reading in the first motion, behind the start-up check."""


@pytest.mark.usefixtures("quick_limits")
def test_a_motion_in_which_the_computer_stood_still_is_played_again(
    elbow: Rig, begin: Callable[..., Any]
) -> None:
    done, said = begin(PausingPort(elbow, (FILLING,)), refused="small steps of the angle")
    assert "the computer stood still for 0.30 s: the air was let out slowly" in "\n".join(said)
    assert [step.motion for step in done.steps] == ["filling"]
    assert "not agreed to" in done.ended


@pytest.mark.usefixtures("quick_limits")
def test_a_computer_that_stands_still_in_every_motion_is_the_reason(
    elbow: Rig, begin: Callable[..., Any]
) -> None:
    done, _ = begin(PausingPort(elbow, tuple(range(FILLING, 10**5, 40))))
    assert "filling: the computer stood still for 0.30 s" in done.ended
