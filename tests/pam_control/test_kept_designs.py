"""Designed gains are shared by equal joints and kept for the next start of the controller."""

import dataclasses
import functools
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.feedback import kept_designs
from pam_control.feedback.gain_design import (
    EXPONENT_BOUNDS,
    INFEASIBLE,
    OMEGA,
    WORSE_THAN_ANY,
    DesignTask,
    PidCost,
)
from pam_control.feedback.kept_designs import KeptDesigns, user_cache_folder
from pam_control.feedback.linear_joint import frequency_response
from pam_control.feedback.margins import pid_response
from pam_control.settings import ControlSettings
from pam_model.rig import rig_from_parameters


def plain_settings(**given):
    """Settings without soft gains at one stiffness, so that one joint needs one design."""
    return ControlSettings(**{"safe_delay": 0.0, "stiffness_grid": (12.0,), **given})


def arm_of(rig, count):
    """`count` joints that are all the elbow, under other names and on other boards."""
    tree = rig.to_parameters()
    tree["joints"] = [f"joint_{index}" for index in range(count)]
    for index, name in enumerate(tree["joints"]):
        muscles = [f"{name}_flexor", f"{name}_extensor"]
        tree[name] = {**tree["elbow"], "muscles": muscles}
        tree[name]["encoder"] = {"board": index, "channel": 0}
        for channel, muscle in enumerate(muscles):
            tree[muscle] = {**tree["elbow_flexor"], "board": index, "channel": channel}
    for name in ("elbow", "elbow_flexor", "elbow_extensor"):
        del tree[name]
    return rig_from_parameters(tree)


@pytest.fixture(scope="module", autouse=True)
def searched_once():
    """The store is held here, not the search, which finds the same gains for the same task."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept_designs, "_design", functools.cache(kept_designs._design))
        yield


def started(rig, folder, **settings):
    """Gains by joint and what the designs report, of a controller that starts now."""
    designs = KeptDesigns(folder)
    controller = Controller(rig, plain_settings(**settings), designs)
    return controller.settings.gains, designs.take_report()


@pytest.fixture(scope="module")
def task(rig):
    controller = Controller(rig, plain_settings())
    channel, settings = controller.channels[0], controller.settings
    return DesignTask(
        tuple(controller.design.cases(channel.models, settings)),
        controller.design.timing(channel.models, settings),
        settings.phase_margin,
        settings.sensitivity,
        settings.derivative_filter,
        lead=0.02,
    )


@pytest.fixture(scope="module")
def fresh(rig):
    return Controller(rig, plain_settings()).settings.gains["elbow"]


@pytest.fixture(scope="module")
def kept_file(rig, tmp_path_factory):
    """The file of the elbow's design."""
    folder = tmp_path_factory.mktemp("kept")
    started(rig, folder)
    (path,) = folder.glob(f"*{kept_designs.GAINS}")
    return path


def test_equal_joints_share_one_design(rig, fresh):
    gains, report = started(arm_of(rig, 7), None)
    assert (report.designed, report.shared, report.read) == (1, 6, 0)
    assert list(gains.values()) == [fresh] * 7


def test_the_next_start_reads_the_design_of_this_one(rig, fresh, tmp_path):
    folder = tmp_path / "not" / "there" / "yet"
    first, report = started(rig, folder)
    assert (report.designed, report.read, report.problem) == (1, 0, "")
    again, report = started(rig, folder)
    assert (report.designed, report.read) == (0, 1)
    assert again == first == {"elbow": fresh}
    kept = ["".join(path.suffixes) for path in folder.iterdir()]
    assert kept.count(".gains.json") == 1
    assert set(kept) == {".gains.json", ".poles.json"}


def with_elbow(rig, **changes):
    return rig.with_joint(dataclasses.replace(rig.joints[0], **changes))


def with_flexor(rig, **changes):
    return rig.with_muscle(dataclasses.replace(rig.muscle("elbow_flexor"), **changes))


@pytest.mark.sampled("four changes: of joint, muscle, rig and settings", cases=4)
@pytest.mark.parametrize(
    "change",
    [
        lambda rig: (with_elbow(rig, inertia=0.0500001), {}),
        lambda rig: (with_elbow(rig, effects={"payload": {"mass": 1e-4}}), {}),
        lambda rig: (with_flexor(rig, dead_volume=2.1e-5), {}),
        lambda rig: (with_flexor(rig, effects={"command_delay": {"delay": 1e-6}}), {}),
        lambda rig: (dataclasses.replace(rig, supply_pressure=6e5), {}),
        lambda rig: (rig, {"measurement_delay": 0.0011}),
        lambda rig: (rig, {"phase_margin": 0.9}),
        lambda rig: (rig, {"sensitivity": 1.7}),
        lambda rig: (rig, {"derivative_filter": 0.011}),
        lambda rig: (rig, {"feedforward": False}),
        lambda rig: (rig, {"stiffness_grid": (12.001,)}),
    ],
    ids=[
        "inertia", "payload", "dead volume", "delay", "supply", "measurement delay", "phase margin",
        "sensitivity", "filter", "feedforward", "stiffness",
    ],
)  # fmt: skip
def test_whatever_changes_the_gains_changes_the_key(rig, tmp_path, change):
    """A kept design serves exactly where a new one would give the same numbers."""
    started(rig, tmp_path)
    other, settings = change(rig)
    expected, _ = started(other, None, **settings)
    found, _ = started(other, tmp_path, **settings)
    assert found == expected


def test_a_later_start_does_not_import_python_control(rig, tmp_path):
    """The import takes longer than all the rest of the controller's start."""
    started(rig, tmp_path)
    program = (
        "import sys\nfrom pathlib import Path\n"
        "from pam_control.feedback.kept_designs import KeptDesigns\n"
        "from pam_control.controller import Controller\n"
        "from pam_control.settings import ControlSettings\n"
        "from pam_model.rig import load_rig\n"
        "Controller(load_rig('config/elbow.yaml'),\n"
        "    ControlSettings(safe_delay=0.0, stiffness_grid=(12.0,)),\n"
        "    KeptDesigns(Path(sys.argv[1])))\n"
        "print('control' in sys.modules, 'matplotlib' in sys.modules)\n"
    )
    words = [sys.executable, "-c", program, str(tmp_path)]
    told = subprocess.run(words, capture_output=True, text=True, check=True, timeout=120)
    assert told.stdout.split() == ["False", "False"]


@pytest.mark.parametrize("spoilt", ["true", "[]", "[[true]]", '"yes"', "null"])
def test_a_spoilt_answer_on_stability_is_decided_again(rig, tmp_path, spoilt):
    started(rig, tmp_path)
    texts = {path: path.read_text() for path in tmp_path.glob(f"*{kept_designs.POLES}")}
    assert texts
    for path, text in texts.items():
        path.write_text(text.replace(json.dumps(json.loads(text)["stable"]), spoilt))
    started(rig, tmp_path)
    assert {path: path.read_text() for path in texts} == texts


def test_other_code_designs_anew(rig, tmp_path, monkeypatch):
    started(rig, tmp_path)
    monkeypatch.setattr(kept_designs, "code_version", lambda: "of another release")
    _, report = started(rig, tmp_path)
    assert (report.designed, report.read) == (1, 0)


def _spoil_gains(**gains):
    def spoil(path):
        kept = json.loads(path.read_text())
        kept["gains"].update(gains)
        path.write_text(json.dumps(kept))

    return spoil


def _spoil_key(path):
    kept = json.loads(path.read_text())
    kept["key"]["timing"]["period"] = 0.01
    path.write_text(json.dumps(kept))


def _unsafe(path):
    """Unstable gains, with the very cost that they have."""
    kept = json.loads(path.read_text())
    kept["gains"] = {"kp": 6.5, "ki": 5000.0, "kd": 1.0}
    kept["cost"] = 1e6
    path.write_text(json.dumps(kept))


def _folder_instead(path):
    path.unlink()
    path.mkdir()


def _link_nowhere(path):
    path.unlink()
    path.symlink_to("/nowhere/at/all")


@pytest.mark.sampled("four of the sixteen ways to spoil a file", cases=4)
@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-20]),
        lambda path: path.write_bytes(bytes(range(256))),
        lambda path: path.write_text("[" * 100_000),
        lambda path: path.write_text("null"),
        lambda path: path.write_text('{"gains": {"kp": 1, "ki": 1, "kd": 1}}'),
        _spoil_gains(kp=float("nan")),
        _spoil_gains(kp=float("inf")),
        _spoil_gains(ki=-1.0),
        _spoil_gains(ki="10"),
        _spoil_gains(ki=10**400),
        _spoil_gains(ki=5000.0),
        _unsafe,
        _spoil_key,
        _folder_instead,
        _link_nowhere,
    ],
    ids=[
        "empty", "cut off", "bytes", "deep", "null", "half", "NaN", "infinite", "negative", "text",
        "huge", "other gains", "unsafe", "other task", "folder", "dead link",
    ],
)  # fmt: skip
def test_a_spoilt_design_is_designed_again(rig, fresh, kept_file, tmp_path, spoil):
    path = tmp_path / kept_file.name
    path.write_bytes(kept_file.read_bytes())
    spoil(path)
    gains, report = started(rig, tmp_path)
    assert (report.designed, report.read) == (1, 0)
    assert gains == {"elbow": fresh}


def test_a_spoilt_file_is_replaced_by_a_good_one(rig, kept_file, tmp_path):
    (tmp_path / kept_file.name).write_bytes(b"spoilt")
    started(rig, tmp_path)
    _, report = started(rig, tmp_path)
    assert (report.designed, report.read) == (0, 1)


def test_a_folder_that_cannot_be_written_costs_nothing_but_time(rig, fresh, tmp_path):
    blocked = tmp_path / "a_file"
    blocked.write_text("in the way of the folder")
    gains, report = started(rig, blocked / "pam_control")
    assert gains == {"elbow": fresh}
    assert str(blocked) in report.problem
    assert "not kept for the next start" in str(report)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_costs_nothing_but_time(rig, fresh, tmp_path):
    tmp_path.chmod(0o500)
    gains, report = started(rig, tmp_path)
    assert gains == {"elbow": fresh}
    assert report.problem


def test_only_so_many_designs_are_kept_and_foreign_files_stay(rig, tmp_path, monkeypatch):
    started(with_elbow(rig, inertia=0.04), tmp_path)
    of_one_start = len(list(tmp_path.iterdir()))
    monkeypatch.setattr(kept_designs, "MOST_FILES", of_one_start)
    foreign = tmp_path / "notes.json"
    foreign.write_text("mine")
    for inertia in (0.05, 0.06):
        started(with_elbow(rig, inertia=inertia), tmp_path)
    assert foreign.read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == of_one_start + 1
    _, report = started(with_elbow(rig, inertia=0.06), tmp_path)
    assert report.read == 1


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"XDG_CACHE_HOME": "/var/c", "HOME": "/home/u"}, "/var/c/pam_control"),
        ({"XDG_CACHE_HOME": "relative", "HOME": "/home/u"}, "/home/u/.cache/pam_control"),
        ({"HOME": "/home/u"}, "/home/u/.cache/pam_control"),
        ({}, "None"),
    ],
)
def test_the_folder_follows_the_xdg_specification(environment, expected):
    assert str(user_cache_folder(environment)) == expected


def test_the_cost_of_a_design_is_its_definition(task):
    """Real arithmetic and counted turns against complex numbers and an unwrapped phase."""
    cost = PidCost(task)
    plant = np.array([frequency_response(c.point, c.loop, task.timing, OMEGA) for c in task.cases])
    hertz = OMEGA / (2.0 * np.pi)
    inside = (hertz >= task.band[0]) & (hertz <= task.band[1])
    draw = np.random.default_rng(3)
    kinds = set()
    for _ in range(400):
        gains = cost.gains(draw.uniform(*np.transpose(EXPONENT_BOUNDS)))
        opened = pid_response(gains, task.timing, OMEGA) * plant
        returned = 1.0 + opened
        end = np.unwrap(np.angle(returned), axis=1)[:, -1]
        found = cost.of(gains)
        if np.any(np.abs(end) > 0.5 * np.pi):
            kinds.add("unstable")
            assert found >= WORSE_THAN_ANY
            continue
        assert found < WORSE_THAN_ANY
        error = np.sqrt(np.mean(np.abs(returned[:, inside]) ** -2.0, axis=1)).max()
        fast = np.abs(returned).min() >= 1.0 / task.sensitivity
        if not fast:
            kinds.add("too sensitive")
            assert found > INFEASIBLE * (1.0 / np.abs(returned).min() - task.sensitivity)
        elif found < INFEASIBLE:
            kinds.add("feasible")
            assert found == pytest.approx(error, rel=1e-9)
    assert kinds == {"unstable", "too sensitive", "feasible"}
