"""What each package imports is what its package.xml, requirements.in and docs/install.md name."""

from __future__ import annotations

import re
import runpy
import xml.etree.ElementTree as ET
from collections.abc import Set
from typing import Any

import pytest
import setuptools

from support.source_tree import ALL_PACKAGES, PACKAGES, ROOT, SOURCE, foreign_imports

# rosdep's keys (ros/rosdistro, rosdep/python.yaml) by the name that Python imports; packages of
# ROS and of this suite are their own keys.
ROSDEP_KEYS = {
    "PIL": "python3-pil",
    "argcomplete": "python3-argcomplete",
    "can": "python3-can",
    "h5py": "python3-h5py",
    "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib",
    "msgpack": "python3-msgpack",
    "numpy": "python3-numpy",
    "pandas": "python3-pandas",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "tqdm": "python3-tqdm",
    "yaml": "python3-yaml",
}
ROS = {
    "ament_index_python", "builtin_interfaces", "control_msgs", "diagnostic_msgs", "launch",
    "launch_ros", "lifecycle_msgs", "rcl_interfaces", "rclpy", "rosidl_parser", "sensor_msgs",
    "std_msgs", "std_srvs", "trajectory_msgs", "visualization_msgs",
}  # fmt: skip
# rosdep has no keys for these, or keys that only pip can install, with which nothing is released: a
# package.xml names none of them. Without numba every package works, slower; what needs one of the
# others says so (`NEEDED_FOR`; Dask and rerun-sdk where they are imported).
OPTIONAL = {
    "numba", "dask", "distributed", "rerun", "pyarrow", "backports", "bokeh", "canopen", "cantools",
    "control", "rosbags", "gymnasium",
}  # fmt: skip
# declared although no file imports them
USED_OTHERWISE = {
    **{
        (package, "pam_cli"): "its messages and help texts name the command pam"
        for package in PACKAGES
        if package not in {"pam_ros", "pam_model", "pam_cli"}
    },
    ("pam_bringup", "pam_control"): "a launch file starts its node",
    ("pam_bringup", "pam_driver"): "a launch file starts its node",
    ("pam_bringup", "pam_model"): "a launch file starts its node",
    ("pam_bringup", "pam_robot"): "a launch file starts its node",
    ("pam_bringup", "pam_sim"): "a launch file starts its node",
    ("pam_demo", "pam_robot"): "it starts its program",
    ("pam_bringup", "robot_state_publisher"): "a launch file starts it if it is installed",
}
# names on the package index, where they differ from the names that Python imports
INDEX_NAMES = {
    "PIL": "pillow",
    "backports": "backports-zstd",
    "can": "python-can",
    "rerun": "rerun-sdk",
    "yaml": "pyyaml",
}


def declared(package: str) -> set[str]:
    """Keys that a package.xml names as needed to run."""
    tree = ET.parse(SOURCE / package / "package.xml")
    return {
        str(entry.text)
        for tag in ("depend", "exec_depend")
        for entry in tree.getroot().findall(tag)
    }


def required(name: str) -> str | None:
    """The key that an import asks for; None where it has none."""
    if name in ROS or name in PACKAGES:
        return name
    return ROSDEP_KEYS.get(name)


def undeclared(imports: Set[str], keys: Set[str]) -> list[str]:
    """Imports that no key stands for."""
    return sorted(name for name in imports - OPTIONAL if required(name) not in keys)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_is_declared_in_package_xml(package):
    imports = foreign_imports(package)
    missing = undeclared(imports.keys(), declared(package))
    assert not missing, {
        name: (required(name) or "no rosdep key", imports[name]) for name in missing
    }


@pytest.mark.parametrize("package", PACKAGES)
def test_package_xml_declares_nothing_that_is_not_used(package):
    used = {required(name) for name in foreign_imports(package)}
    used |= {key for owner, key in USED_OTHERWISE if owner == package}
    assert declared(package) <= used


def test_a_forgotten_dependency_is_found():
    keys = declared("pam_gap")
    assert "python3-jinja2" in keys
    assert undeclared({"jinja2", "numpy", "numba"}, keys - {"python3-jinja2"}) == ["jinja2"]
    assert undeclared({"a_package_without_a_key"}, keys) == ["a_package_without_a_key"]


def test_what_starts_another_packages_node_depends_on_that_package():
    for launch_file in sorted((SOURCE / "pam_bringup/launch").glob("*.launch.py")):
        started = set(re.findall(r'package="(\w+)"', launch_file.read_text()))
        assert started <= declared("pam_bringup"), launch_file.name


def test_requirements_name_every_import_that_is_not_of_ros():
    files = ("requirements.in", "requirements-view.txt")
    text = "".join((ROOT / name).read_text().lower() for name in files)
    listed = set(re.findall(r"^([a-z0-9-]+)", text, re.MULTILINE))
    wanted = {name for package in ALL_PACKAGES for name in foreign_imports(package)}
    wanted -= ROS | set(PACKAGES)
    assert {INDEX_NAMES.get(name, name) for name in wanted} <= listed


def test_the_installation_page_names_what_ubuntu_does_not_have():
    page = (ROOT / "docs/install.md").read_text()
    for name in OPTIONAL:
        assert f"`{INDEX_NAMES.get(name, name)}`" in page, name


def setup_lists(package: str, monkeypatch: pytest.MonkeyPatch) -> tuple[set[str], set[str]]:
    """What pip installs with a package, and what it installs with one of its extras."""
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: given.update(arguments))
    monkeypatch.chdir(SOURCE / package)
    runpy.run_path("setup.py")
    extras = given["extras_require"]
    return set(given["install_requires"]), {one for name in extras for one in extras[name]}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_wheel_requires_what_its_package_imports(package, monkeypatch):
    """As requirements.in does, and the other packages of the suite in its own version."""
    required_lines, extra_lines = setup_lists(package, monkeypatch)
    version = ET.parse(SOURCE / package / "package.xml").getroot().findtext("version")
    files = ("requirements.in", "requirements-view.txt")
    known = {line for name in files for line in (ROOT / name).read_text().splitlines()}
    known |= {f"{name}=={version}" for name in PACKAGES} | {"pytest"}
    known |= {f"{name}[{extra}]=={version}" for name in PACKAGES for extra in ("ros", "compiled")}
    assert required_lines | extra_lines <= known
    by_name = {re.split(r"[\[<>=]", line)[0] for line in required_lines}
    offered = by_name | {re.split(r"[\[<>=]", line)[0] for line in extra_lines}
    wanted = {INDEX_NAMES.get(name, name) for name in foreign_imports(package).keys() - ROS}
    through_model = {"numba"}  # whoever simulates in Python alone does so through pam_model
    assert wanted - through_model <= offered
    only_extra = {
        INDEX_NAMES.get(name, name)
        for name in ("numba", "dask", "distributed", "rerun", "pyarrow", "gymnasium")
    }
    assert wanted - only_extra <= by_name
