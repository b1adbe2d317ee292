"""The launch files name packages and executables that exist; launch itself is not needed."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from pam_control.controller_parameters import parameter_table
from pam_driver.driver_parameters import TABLE as DRIVER_PARAMETERS
from pam_sim.rig_node import PARAMETERS as RIG_PARAMETERS

ROOT = Path(__file__).parents[2]
LAUNCH_FILES = sorted((ROOT / "src/pam_bringup/launch").glob("*.launch.py"))


def started_nodes(path: Path) -> set[tuple[str, str]]:
    """Package and executable of every Node in a launch file."""
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    found = set()
    for call in calls:
        if isinstance(call.func, ast.Name) and call.func.id == "Node":
            words = {word.arg: word.value for word in call.keywords}
            package, executable = words["package"], words["executable"]
            assert isinstance(package, ast.Constant)
            assert isinstance(executable, ast.Constant)
            found.add((str(package.value), str(executable.value)))
    return found


def console_scripts(package: str) -> set[str]:
    """Names that a package's setup.py installs."""
    tree = ast.parse((ROOT / "src" / package / "setup.py").read_text())
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return {text.split(" = ")[0] for text in texts if isinstance(text, str) and ":main" in text}


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_every_started_node_is_installed(path):
    nodes = started_nodes(path)
    assert nodes
    for package, executable in nodes:
        assert executable in console_scripts(package)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("robot.launch.py", [*DRIVER_PARAMETERS, *parameter_table([])]),
        ("simulation.launch.py", RIG_PARAMETERS),
    ],
)
def test_every_parameter_given_to_a_node_is_one_of_its_own(name, parameters):
    tree = ast.parse((ROOT / "src/pam_bringup/launch" / name).read_text())
    dicts = [node for node in ast.walk(tree) if isinstance(node, ast.Dict)]
    keys = {key.value for each in dicts for key in each.keys if isinstance(key, ast.Constant)}
    assert "bus.channel" in keys
    assert keys <= {parameter.name for parameter in parameters}


def test_there_is_one_for_a_robot_and_one_for_the_simulated_rig():
    names = {path.name: started_nodes(path) for path in LAUNCH_FILES}
    robot = {"pam_driver", "pam_model", "pam_control"}
    assert {package for package, _ in names["robot.launch.py"]} == robot
    assert {package for package, _ in names["simulation.launch.py"]} == {"pam_sim"}
