"""Every dependency in a package.xml is a name that rosdep knows for ROS 2 Jazzy."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest

from support.source_tree import PACKAGES, ROOT, SOURCE

DATA = ROOT / "tests/data/rosdistro"
KNOWN = {
    name
    for file in ("rosdep_python_keys.txt", "jazzy_packages.txt")
    for name in (DATA / file).read_text().split()
}


def unknown(text: str) -> list[str]:
    """Dependencies of a package.xml that rosdep could not resolve."""
    tags = re.compile(r"(build_|exec_|test_|build_export_|buildtool_)?depend")
    named = {str(tag.text) for tag in ET.fromstring(text) if tags.fullmatch(tag.tag)}
    return sorted(named - KNOWN - set(PACKAGES))


@pytest.mark.parametrize("package", PACKAGES)
def test_rosdep_knows_every_dependency(package):
    assert unknown((SOURCE / package / "package.xml").read_text()) == []


def test_a_name_that_rosdep_does_not_know_is_found():
    text = "<package><exec_depend>python3-numpi</exec_depend><depend>rclpy</depend></package>"
    assert unknown(text) == ["python3-numpi"]


def test_the_image_installs_by_rosdep_and_by_pip_what_ubuntu_does_not_have():
    text = (ROOT / "docker/Dockerfile").read_text()
    assert "FROM ros:jazzy" in text
    assert "PIP_BREAK_SYSTEM_PACKAGES=1" in text
    assert "rosdep install --from-paths src --ignore-src" in text
