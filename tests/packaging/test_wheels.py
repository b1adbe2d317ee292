"""The wheels, made from the sources that a release publishes, in an environment that has no ROS.

This needs the package index, as `make setup` does; pip takes from its cache what it has.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from support.source_tree import PACKAGES, ROOT, SOURCE

pytestmark = pytest.mark.long(
    "test_dependencies compares what a wheel requires with what is imported, test_missing_packages "
    "runs without ROS"
)

WANTED = ("pam_control", "pam_gap[compiled]")
COMMANDS = (
    ("pam", "--help"), ("pam", "model", "list", "--help"), ("pam", "gap", "diagnose", "--help"),
    ("pam_model", "--help"), ("pam_gap", "--help"),
    ("pam_diagnose", "--help"), ("pam_control", "--help"), ("pam", "gap", "--version"),
)  # fmt: skip
NEEDS_ROS = {"motion_for_diagnosis", "sinusoid_node"}
EXAMPLES = sorted({path.stem for path in (ROOT / "examples").glob("*.py")} - NEEDS_ROS)
VERSION = re.search(r"<version>(.*)<", (SOURCE / "pam_model/package.xml").read_text())[1]


def run(words: list[str | Path], folder: Path, seconds: float = 600.0) -> str:
    """Standard output of a program that knows neither our environment nor our folder."""
    ended = subprocess.run(
        words,
        cwd=folder,
        env={"HOME": os.environ["HOME"], "PATH": "/usr/bin:/bin", "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )
    assert ended.returncode == 0, f"{words}: {ended.stdout[-2000:]}{ended.stderr[-2000:]}"
    return ended.stdout


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source archive of each package, and the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("archives")
    for package in PACKAGES:
        copy = folder / "src" / package
        shutil.copytree(
            SOURCE / package,
            copy,
            ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "build"),
        )
        run([sys.executable, "setup.py", "-q", "sdist", "-d", folder], copy)
        run(
            [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w",
             folder, folder / f"{package}-{VERSION}.tar.gz"],
            folder,
        )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def desk(archives: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of a user with examples and a rig file, and an environment of its own."""
    folder = tmp_path_factory.mktemp("desk")
    shutil.copytree(ROOT / "examples", folder / "examples")
    (folder / "config").mkdir()
    shutil.copy(ROOT / "config/elbow.yaml", folder / "config")
    run([Path(sys.executable).resolve(), "-m", "venv", folder / "env"], folder)
    pins = re.findall(r"^([\w.-]+==\S+)", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
    (folder / "pins.txt").write_text("\n".join(pins))
    run(
        [folder / "env/bin/python", "-m", "pip", "install", "-q", "--disable-pip-version-check",
         "-f", archives, "-c", "pins.txt", *WANTED],
        folder,
    )  # fmt: skip
    return folder


@pytest.mark.parametrize("package", PACKAGES)
def test_source_archive_and_wheel_hold_every_file_of_the_package(package, archives):
    wanted = {
        path.relative_to(SOURCE / package).as_posix()
        for path in (SOURCE / package / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    with zipfile.ZipFile(archives / f"{package}-{VERSION}-py3-none-any.whl") as wheel:
        assert wanted <= set(wheel.namelist())
        assert f"{package}/py.typed" in wanted
    with tarfile.open(archives / f"{package}-{VERSION}.tar.gz") as source:
        names = {name.partition("/")[2] for name in source.getnames()}
    assert wanted | {"package.xml", "LICENSE", "CHANGELOG.rst", "setup.py"} <= names


def test_nothing_of_this_environment_is_seen(desk):
    code = (
        "import importlib.util as u, pam_model, pam_gap, pam_control\n"
        "print(pam_model.__file__, pam_gap.__version__, u.find_spec('rclpy'), u.find_spec('mypy'))"
    )
    path, *rest = run([desk / "env/bin/python", "-c", code], desk).split()
    assert Path(path).is_relative_to(desk)
    assert rest == [VERSION, "None", "None"]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_a_command_answers(words, desk):
    said = run([desk / "env/bin" / words[0], *words[1:]], desk, 60.0)
    assert said.startswith(f"pam_gap {VERSION}" if "--version" in words else "usage: ")


def test_a_node_says_in_one_line_that_it_needs_ros(desk):
    ended = subprocess.run(
        [desk / "env/bin/pam", "gap", "monitor"], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
    assert "pip install 'pam_ros[ros]'" in ended.stderr


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs(name, desk):
    run([desk / "env/bin/python", f"examples/{name}.py"], desk)


def test_the_page_about_python_runs(desk):
    page = (ROOT / "docs/python.md").read_text()
    snippets = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert snippets
    for snippet in snippets:
        run([desk / "env/bin/python", "-c", snippet], desk)
