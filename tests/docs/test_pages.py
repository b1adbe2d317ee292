"""Pages say what is so: links lead somewhere, examples run, commands are commands of the suite."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from pam_model.errors import RigError
from pam_model.rig import rig_from_parameters

from .check_command import problem_of
from .pages import (
    PAGES,
    ROOT,
    anchors,
    blocks,
    commands_in_blocks,
    commands_in_sentences,
    links,
)

NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
LANGUAGES = {"bash", "python", "yaml", "json", "text", "mermaid"}


@pytest.fixture(params=PAGES, ids=NAMES)
def page(request) -> Path:
    return request.param


def test_links_lead_to_files_and_headings(page):
    for link in links(page.read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{link}: there is no {target}"
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{link}: no such heading"


def test_every_page_is_in_the_list_of_pages():
    listed = set(links((ROOT / "docs/README.md").read_text(encoding="utf-8")))
    pages = {path.name for path in (ROOT / "docs").glob("*.md")}
    assert pages - listed == {"README.md", "changes.md", "contributing.md"}


def test_the_first_page_sends_no_reader_through_a_list_of_links():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 90
    for paragraph in text.split("\n\n"):
        assert len(list(links(paragraph))) <= 8, paragraph


def test_commands_are_commands_of_the_suite(page):
    text = page.read_text(encoding="utf-8")
    found = [problem_of(command) for command in commands_in_blocks(text)]
    found += [problem_of(command, is_complete=False) for command in commands_in_sentences(text)]
    assert [problem for problem in found if problem] == []


def test_every_block_says_what_it_is(page):
    for block in blocks(page.read_text(encoding="utf-8")):
        assert block.language in LANGUAGES, f"line {block.line}: {block.language!r}"


def test_python_blocks_run(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}  # later blocks of a page may use what earlier ones made
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.language == "python":
            exec(compile(block.text, f"{page.name}:{block.line}", "exec"), names)


def test_yaml_and_json_blocks_can_be_read(page):
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.language == "yaml":
            yaml.safe_load(block.text)
        elif block.language == "json":
            json.loads(block.text)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("./pam gap diagnoze recording --rig RIG --out OUT", "diagnoze"),
        ("./pam gap diagnose recording --rig RIG --outt OUT", "--outt"),
        ("./pam gap diagnose recording", "--rig"),
        ("./pam nothing list", "nothing"),
        ("./pam check faults --trials many", "many"),
        ("pam check faults", "pam is neither"),
        ("python -m pam_gap diagnose recording --rig RIG --out OUT", "python is neither"),
        (".venv/bin/python -m pam_gap diagnose recording", "begin with ./pam"),
        ("ros2 run pam_gap diagnoze", "diagnoze"),
        ("./pam driver node --ros-args -p bus.chanel:=can0", "bus.chanel"),
        ("ros2 launch pam_bringup robots.launch.py", "robots.launch.py"),
        ("ros2 launch pam_bringup robot.launch.py rigfile:=a.yaml", "rigfile"),
        ("ros2 topic pub --once /a sensor_msgs/msg/JointStates '{}'", "JointStates"),
        ("ros2 topic pub --once /a sensor_msgs/msg/JointState '{names: [a]}'", "names"),
        ("ros2 service call /pam_driver/vent std_srvs/srv/Triger", "Triger"),
        ("make report2", "report2"),
        ("tools/no_such_tool.sh", "no_such_tool"),
        (".venv/bin/python benchmarks/no_such_bench.py", "no_such_bench"),
        ("frobnicate --now", "frobnicate"),
    ],
)
def test_a_false_command_would_be_found(command, said):
    assert said in (problem_of(command) or "")


def test_the_excerpt_of_a_rig_file_has_keys_of_a_rig_file():
    """It is no whole rig, so it is refused; but not for a key that nobody knows."""
    text = (ROOT / "docs/rig_file.md").read_text(encoding="utf-8")
    excerpt = next(block for block in blocks(text) if "joints: [elbow]" in block.text)
    tree = yaml.safe_load(excerpt.text)["/**"]["ros__parameters"]
    with pytest.raises(RigError, match="missing") as refused:
        rig_from_parameters(tree)
    assert "unknown key" not in str(refused.value)
