"""The command `pam` finds the tools of all installed packages, and imports only the one it runs."""

from __future__ import annotations

import json
from importlib.metadata import entry_points

import pytest

from pam_cli.__main__ import GROUP, main
from support.source_tree import PACKAGES, ROOT

SCRIPTS = [entry for entry in entry_points(group="console_scripts") if entry.name[:3] == "pam"]


def test_help_lists_every_tool(capsys):
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    for entry in entry_points(group=GROUP):
        assert f"    {entry.name} " in told


def test_an_unknown_tool_is_one_line(capsys):
    assert main(["gaap", "diagnose"]) == 2
    told = capsys.readouterr()
    assert (told.out, told.err.count("\n")) == ("", 1)
    assert "gap" in told.err


@pytest.mark.parametrize("entry", entry_points(group=GROUP), ids=lambda entry: entry.name)
def test_a_tool_is_reached_by_pam_and_by_a_program_with_the_name_of_its_package(entry):
    """The second one is what `ros2 run PACKAGE PACKAGE COMMAND` starts."""
    package = entry.module.partition(".")[0]
    assert package == f"pam_{entry.name}"
    if package in PACKAGES:
        (script,) = [one for one in SCRIPTS if one.name == package]
        assert script.value == f"{package}.__main__:main"


def test_no_program_has_a_name_that_others_may_use():
    names = [script.name for script in SCRIPTS]
    assert len(names) == len(set(names))
    assert {script.module.partition(".")[0] for script in SCRIPTS} <= {*PACKAGES, "pam_check"}
    ours = [
        entry
        for entry in entry_points(group="console_scripts")
        if entry.module.partition(".")[0] in PACKAGES
    ]
    assert {entry.name for entry in ours} == set(names)  # each begins with pam


@pytest.mark.parametrize("old", ["controller_node", "driver_node", "model_node"])
def test_scripts_for_an_earlier_source_tree_find_its_nodes(old):
    place = ROOT / ".venv/bin" / old
    if not (ROOT / ".venv/bin/pam").exists():
        pytest.skip("the suite is not installed by make setup")
    assert place.resolve() == ROOT / ".venv/bin" / f"pam_{old}"


def test_colcon_finds_tests_of_every_package():
    settings = json.loads((ROOT / "colcon.meta").read_text())["names"]
    assert settings.keys() == set(PACKAGES)
    for package, given in settings.items():
        folder = ROOT / "src" / package / given["pytest-args"][0]
        assert list(folder.resolve().glob("test_*.py")), folder
