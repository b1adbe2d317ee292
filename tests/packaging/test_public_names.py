"""The short face of each package: what is public, documented, and quick to import."""

from __future__ import annotations

import importlib
import inspect
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

import pam_gap
import pam_model
from support.source_tree import PACKAGES, ROOT, SOURCE

PUBLIC = {
    "pam_bringup": set(),
    "pam_cli": set(),
    "pam_control": {
        "ControlOutput", "ControlSettings", "Controller", "Law", "Measurement",
        "PressureRatioPid", "TrajectoryPoint",
    },
    "pam_demo": set(),
    "pam_driver": {"CanPort", "Driver", "DriverSettings", "open_bus"},
    "pam_gap": {
        "Diagnosis", "Recording", "RecordingError", "diagnose", "diagnose_files",
        "import_recording",
    },
    "pam_model": {
        "JointStatics", "EFFECTS", "MuscleGeometry", "PamError", "Plant", "PlantParameters",
        "Rig", "RigError", "compare", "create_force_model", "fit", "initial_state", "load_rig",
        "load_measurements", "registered_models", "save_rig", "simulate", "simulate_measured",
    },
    "pam_ros": {
        "NodeParameters", "Parameter", "PeriodicLoop", "leave_out_shared_memory", "spin_node",
    },
    "pam_robot": set(),
    "pam_sim": {"RigLoop", "SimulatedRig"},
}  # fmt: skip
PAGE = ROOT / "docs/python.md"


def face(package: str) -> ModuleType:
    """The package as a user imports it."""
    return importlib.import_module(package)


def loaded_by(line: str) -> set[str]:
    """The modules that a fresh interpreter holds after a line of Python."""
    command = f"{line}\nimport sys\nprint(' '.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, timeout=60, check=True
    )
    return set(done.stdout.split())


@pytest.mark.parametrize("package", PACKAGES)
def test_the_public_names_are_these(package):
    assert set(getattr(face(package), "__all__", ())) == PUBLIC[package]


@pytest.mark.parametrize(
    ("package", "name"),
    [(package, name) for package in PACKAGES for name in sorted(PUBLIC[package])],
)
def test_a_public_name_is_there_and_documented(package, name):
    thing = getattr(face(package), name)
    assert not inspect.ismodule(thing)
    assert name in dir(face(package))
    if callable(thing):
        assert inspect.getdoc(thing)
    assert f"`{name}`" in (face(package).__doc__ or "")
    assert re.search(rf"^\| `{package}` \|.*`{name}`", PAGE.read_text(), re.MULTILINE), name


@pytest.mark.parametrize("package", PACKAGES)
def test_the_version_is_the_one_that_is_installed(package):
    if PUBLIC[package]:
        about = ET.parse(SOURCE / package / "package.xml").getroot()
        assert face(package).__version__ == about.findtext("version")


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'pam_model' has no attribute 'simulat'"):
        pam_model.simulat  # noqa: B018


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_nothing_else(package):
    bare = loaded_by("")
    ours = loaded_by(f"import {package}") - bare
    allowed = set(sys.stdlib_module_names)
    assert {name for name in ours if name.split(".")[0] not in allowed} == {package}


def test_reading_a_rig_needs_neither_compiler_nor_plots_nor_ros():
    loaded = loaded_by("import pam_model; pam_model.load_rig")
    assert "pam_model.rig" in loaded
    assert not loaded & {"numba", "matplotlib", "pandas", "rclpy", "can", "tqdm"}


def test_the_page_about_python_runs(monkeypatch: pytest.MonkeyPatch, capsys):
    page = PAGE.read_text()
    snippets = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(snippets) == 3
    monkeypatch.chdir(ROOT)
    for snippet in snippets:
        exec(compile(snippet, str(PAGE), "exec"), {})
    force, _, position = capsys.readouterr().out.splitlines()
    assert 50.0 < float(force.split()[0]) < 1000.0
    assert 0.05 < float(position.split()[0]) < 1.5


def test_a_diagnosis_needs_recordings_channels_and_a_joint_of_the_rig(rig, tmp_path):
    with pytest.raises(pam_gap.RecordingError, match="no recording given"):
        pam_gap.diagnose([], rig)
    time = np.arange(0.0, 2.0, 0.01)
    channels = {f"pressure_states.{name}": 1e5 + 0.0 * time for name in rig.muscle_names}
    table = tmp_path / "two_pressures.csv"
    pd.DataFrame({"time": time, **channels}).to_csv(table, index=False)
    recording = pam_gap.import_recording(table)
    with pytest.raises(pam_model.PamError, match="unknown joint 'knee'; known: elbow"):
        pam_gap.diagnose(recording, rig, joint="knee")
    (answer,) = pam_gap.diagnose(recording, rig)
    assert answer.verdict == "not_identifiable"
    assert "joint position" in answer.missing[0]
