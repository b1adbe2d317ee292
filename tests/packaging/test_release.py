"""What a release needs that no machine can guess: one version, told changes, and who to ask."""

from __future__ import annotations

import re
import runpy
import tomllib
import xml.etree.ElementTree as ET

import pytest
import yaml

from support.source_tree import PACKAGES, ROOT, SOURCE

KINDS = {"added", "changed", "deprecated", "removed", "fixed", "security"}
TOOL = runpy.run_path(str(ROOT / "tools/set_version.py"))


def test_all_files_state_one_version():
    found = TOOL["versions"]()
    assert len(found) == 1, found
    files = next(iter(found.values()))
    assert {"CHANGELOG.md", "CITATION.cff"} < files
    assert len(files) == 2 + 2 * len(PACKAGES)


def test_a_version_is_written_into_all_of_them(tmp_path, monkeypatch):
    for name in ("CITATION.cff", "CHANGELOG.md", *(f"src/{one}/{file}" for one in PACKAGES
                 for file in ("package.xml", "CHANGELOG.rst"))):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    monkeypatch.setitem(TOOL["set_version"].__globals__, "ROOT", tmp_path)
    TOOL["main"](["9.8.7", "2031-02-03"])
    found = TOOL["versions"]()
    assert len(found["9.8.7"]) == 1 + 2 * len(PACKAGES)
    assert set(found) - {"9.8.7"} == {ET.parse(SOURCE / "pam_ros/package.xml").findtext("version")}
    assert "9.8.7 (2031-02-03)" in (tmp_path / "src/pam_gap/CHANGELOG.rst").read_text()
    with pytest.raises(SystemExit, match="several versions"):  # towncrier has not been run
        TOOL["main"]([])
    with pytest.raises(SystemExit, match="no version"):
        TOOL["main"](["next"])


def test_changes_are_named_as_towncrier_finds_them():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["towncrier"]
    assert {kind["directory"] for kind in settings["type"]} == KINDS
    assert settings["start_string"] in (ROOT / "CHANGELOG.md").read_text()
    for path in (ROOT / "changes").iterdir():
        if path.name != "README.md":
            assert re.fullmatch(rf"\+[\w-]+\.({'|'.join(KINDS)})\.md", path.name), path.name
            assert path.read_text().strip()


def test_the_changes_of_a_version_fit_on_two_pages():
    text = (ROOT / "CHANGELOG.md").read_text()
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        assert len(section) < 9000, section.splitlines()[0]


def test_the_citation_can_be_read():
    given = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert given["cff-version"] == "1.2.0"
    assert {"title", "authors", "version", "date-released", "license"} < given.keys()
    address = given["authors"][0]["email"]
    for name in PACKAGES:
        author = ET.parse(SOURCE / name / "package.xml").getroot().find("author")
        assert author is not None
        assert author.get("email") == address
    assert address in (ROOT / "SECURITY.md").read_text()
