"""Every package has what a ROS package needs to be built and installed by itself."""

from __future__ import annotations

import importlib
import re
import runpy
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
import setuptools

from support.source_tree import PACKAGES, ROOT, SOURCE

CONFIG = ROOT / "config"
VERSION = ET.parse(SOURCE / "pam_model/package.xml").getroot().findtext("version")
"""All packages are released together."""


def setup_arguments(package: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What a package's setup.py hands to setuptools."""
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: given.update(arguments))
    monkeypatch.chdir(SOURCE / package)
    runpy.run_path("setup.py")
    return given


def installed_files(given: dict[str, Any]) -> list[str]:
    """Paths, as seen from the package's folder, that a setup.py copies as data."""
    return [path for _, paths in given["data_files"] for path in paths]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_says_who_made_it_and_under_which_licence(package, monkeypatch):
    given = setup_arguments(package, monkeypatch)
    root = ET.parse(SOURCE / package / "package.xml").getroot()
    author, maintainer = root.find("author"), root.find("maintainer")
    assert author is not None and maintainer is not None
    for person in (author, maintainer):
        assert person.text and "@" in person.get("email", "")
        assert "example.org" not in person.get("email", "")
    assert root.findtext("license") == given["license"] == "Apache-2.0"
    assert root.findtext("version") == given["version"] == VERSION
    assert root.findtext("name") == given["name"] == package


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_brings_its_licence_and_its_changes(package):
    folder = SOURCE / package
    assert (folder / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    lines = (folder / "CHANGELOG.rst").read_text().splitlines()
    title = f"Changelog for package {package}"
    assert lines[:3] == ["^" * len(title), title, "^" * len(title)]
    assert re.fullmatch(rf"Forthcoming|{re.escape(VERSION)} \(\d{{4}}-\d\d-\d\d\)", lines[4])
    assert lines[5] == "-" * len(lines[4])
    assert any(line.startswith("* ") for line in lines)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_is_built_from_files_of_its_own(package, monkeypatch):
    given = setup_arguments(package, monkeypatch)
    here = SOURCE / package
    for path in installed_files(given):
        assert Path(path).is_file(), path
        assert not Path(path).is_symlink(), f"{path}: a link may point out of the package"
        assert Path(path).resolve().is_relative_to(here), path
    assert {"package.xml", "LICENSE", "CHANGELOG.rst", f"resource/{package}"} <= set(
        installed_files(given)
    )


@pytest.mark.parametrize("package", PACKAGES)
def test_every_data_file_beside_the_code_is_installed(package, monkeypatch):
    """`package_data` counts from the nearest folder with an `__init__.py`."""
    patterns = setup_arguments(package, monkeypatch)["package_data"][""]
    code = SOURCE / package / package
    for path in code.rglob("*"):
        if path.is_dir() or path.suffix == ".py" or "__pycache__" in path.parts:
            continue
        home = next(folder for folder in path.parents if (folder / "__init__.py").is_file())
        inside = path.relative_to(home)
        assert any(
            len(inside.parts) == len(Path(pattern).parts) and inside.match(pattern)
            for pattern in patterns
        ), path


@pytest.mark.parametrize("package", PACKAGES)
def test_every_console_script_is_a_function_that_exists(package, monkeypatch):
    given = setup_arguments(package, monkeypatch)
    for entry in given.get("entry_points", {}).get("console_scripts", []):
        module, function = re.fullmatch(r"\w+ = ([\w.]+):(\w+)", entry).groups()
        assert callable(getattr(importlib.import_module(module), function)), entry


def test_every_file_in_config_is_installed_by_a_package(monkeypatch):
    installed = {
        (SOURCE / package / path).resolve()
        for package in PACKAGES
        for path in installed_files(setup_arguments(package, monkeypatch))
    }
    files = sorted(CONFIG.iterdir())
    assert [path.name for path in files if path.resolve() not in installed] == []
    assert {"elbow.yaml", "two_joints.yaml", "controller.yaml"} <= {path.name for path in files}


def test_config_shows_every_file_that_pam_bringup_installs():
    inside = {path.name: path for path in (SOURCE / "pam_bringup/config").iterdir()}
    assert inside
    for name, path in inside.items():
        assert (CONFIG / name).resolve() == path.resolve(), f"config/{name}: no link to it"
