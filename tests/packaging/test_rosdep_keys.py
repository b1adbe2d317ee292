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


def only_by_pip(text: str) -> list[str]:
    """Dependencies of a package.xml that have a key, but no package of Ubuntu or ROS."""
    return sorted(str(tag.text) for tag in ET.fromstring(text) if str(tag.text).endswith("-pip"))


@pytest.mark.parametrize("package", PACKAGES)
def test_no_dependency_keeps_a_package_from_being_released(package):
    """Bloom releases nothing that depends on a key for pip."""
    assert only_by_pip((SOURCE / package / "package.xml").read_text()) == []
    text = "<package><exec_depend>python3-rosbags-pip</exec_depend></package>"
    assert only_by_pip(text) == ["python3-rosbags-pip"]


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
    by_pip = set(
        re.findall(r"[\w-]+", text.partition("pip install --no-cache-dir")[2].partition("\\")[0])
    )
    assert {"numba", "cantools", "canopen", "control", "rosbags", "bokeh"} <= by_pip
