"""The launch files run, and start what exists with what it takes; launch itself is not needed."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ament_index_python.packages import PackageNotFoundError

from pam_control.controller_parameters import parameter_table
from pam_driver.driver_parameters import TABLE as DRIVER_PARAMETERS
from pam_sim.rig_node import PARAMETERS as RIG_PARAMETERS
from support.fake_launch import Recorded, all_of, install, plain, run_launch_file

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "src/pam_bringup/launch"
ROBOT, SIMULATION = "robot.launch.py", "simulation.launch.py"
DRIVERS = ("pam_robot", "pam_driver")
"""The packages whose process has the driver."""
EVERY_DRIVER = pytest.mark.parametrize("package", DRIVERS)
EVERY_FILE = pytest.mark.parametrize("name", [ROBOT, SIMULATION])


@pytest.fixture(autouse=True)
def _launch(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)


def description(name: str) -> Recorded:
    """What a launch file describes."""
    made: Recorded = run_launch_file(FOLDER / name)["generate_launch_description"]()
    return made


def nodes(name: str) -> dict[str, Recorded]:
    """The nodes that a launch file starts, by their package."""
    return {node["package"]: node for node in all_of("Node", description(name))}


def parameters(node: Recorded) -> dict[str, Any]:
    """What a launch file sets beside the rig file."""
    given = node["parameters"]
    assert [plain(one) for one in given[:2]] == ["rig_file", "params_file"]
    return {key: plain(value) for each in given[2:] for key, value in each.items()}


def of_the_driver(node: Recorded) -> dict[str, Any]:
    """The parameters that a launch file gives to the driver, however its process takes them."""
    if node["package"] != "pam_robot":
        return parameters(node)
    words = node["ros_arguments"]
    assert set(words[::2]) == {"-p"}
    found = {}
    for word in words[1::2]:
        whole = "".join(str(plain(part)) for part in word)
        owner, name, value = whole.replace(":=", ":").split(":")
        assert owner in {"pam_driver", "pam_controller"}, "it would be given to all nodes"
        if owner == "pam_driver":
            found[name] = value.strip("'")
    return found


def arguments(name: str) -> dict[str, Recorded]:
    """The arguments a launch file declares."""
    return {one.given[0]: one for one in all_of("DeclareLaunchArgument", description(name))}


def console_scripts(package: str) -> set[str]:
    """Names that a package's setup.py installs."""
    tree = ast.parse((ROOT / "src" / package / "setup.py").read_text())
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return {text.split(" = ")[0] for text in texts if isinstance(text, str) and " = " in text}


def test_there_is_one_for_a_robot_and_one_for_the_simulated_rig():
    assert {path.name for path in FOLDER.glob("*")} == {ROBOT, SIMULATION}
    assert set(nodes(ROBOT)) == {"pam_robot", "pam_driver", "pam_model", "pam_control"}
    assert set(nodes(SIMULATION)) == {"pam_sim"}


def test_the_nodes_run_in_one_process_unless_they_are_asked_to_run_apart():
    assert {arguments(name)["one_process"]["default_value"] for name in (ROBOT, SIMULATION)} == {
        "true"
    }
    for package, node in nodes(ROBOT).items():
        condition = node["condition"]
        assert plain(condition.given[0]) == "one_process"
        assert condition.kind == ("IfCondition" if package == "pam_robot" else "UnlessCondition")


def test_the_driver_is_told_the_same_in_both_ways():
    told = {package: of_the_driver(nodes(ROBOT)[package]) for package in DRIVERS}
    assert told["pam_robot"] == told["pam_driver"]
    assert "loop.realtime_priority" in str(nodes(ROBOT)["pam_robot"]["ros_arguments"])


@EVERY_FILE
def test_every_started_node_is_installed(name):
    for package, node in nodes(name).items():
        assert node["executable"] in console_scripts(package)


def test_every_parameter_given_to_a_node_is_one_of_its_own():
    robot = nodes(ROBOT)
    known = {
        "pam_robot": set(),
        "pam_driver": {parameter.name for parameter in DRIVER_PARAMETERS},
        "pam_model": set(),
        "pam_control": {parameter.name for parameter in parameter_table([])},
        "pam_sim": {parameter.name for parameter in RIG_PARAMETERS},
    }
    for package, node in (robot | nodes(SIMULATION)).items():
        assert set(parameters(node)) <= known[package], package


@EVERY_FILE
def test_every_node_is_in_the_namespace_that_is_asked_for(name):
    assert arguments(name)["namespace"]["default_value"] == ""
    for package, node in nodes(name).items():
        assert plain(node["namespace"]) == "namespace", package


def test_driver_and_simulated_rig_are_on_the_bus_that_is_asked_for():
    for node in (*(nodes(ROBOT)[each] for each in DRIVERS), nodes(SIMULATION)["pam_sim"]):
        given = of_the_driver(node)
        assert given["bus.interface"] == "bus_interface"
        assert given["bus.channel"] == "bus_channel"
        assert given["bus.port"] == "bus_port"


@EVERY_FILE
def test_every_value_comes_from_an_argument_that_is_declared(name):
    made = description(name)
    asked = {one.given[0] for one in all_of("LaunchConfiguration", made)}
    assert asked <= set(arguments(name))


def test_the_simulation_hands_on_what_the_robots_launch_file_takes():
    (include,) = all_of("IncludeLaunchDescription", description(SIMULATION))
    handed = {key: plain(value) for key, value in include["launch_arguments"]}
    shared = set(arguments(ROBOT)) & set(arguments(SIMULATION))
    assert {"namespace", "bus_port", "on_driver_exit", "params_file"} <= shared
    assert {"respawn", "urdf", "view"} <= shared
    assert {key: handed.get(key) for key in shared} == {key: key for key in shared}
    assert set(handed) <= set(arguments(ROBOT))


def test_moving_air_at_the_start_is_asked_for_in_the_simulation_only():
    assert arguments(ROBOT)["activate_on_start"]["default_value"] == "false"
    assert parameters(nodes(ROBOT)["pam_driver"])["activate_on_start"] == "activate_on_start"
    (include,) = all_of("IncludeLaunchDescription", description(SIMULATION))
    handed = {key: plain(value) for key, value in include["launch_arguments"]}
    assert handed["activate_on_start"] == "true"
    (default,) = [one.default for one in DRIVER_PARAMETERS if one.name == "activate_on_start"]
    assert default is False


def test_a_robot_is_checked_before_it_moves():
    assert arguments(ROBOT)["start_up_check"]["default_value"] == "true"
    assert parameters(nodes(ROBOT)["pam_driver"])["start_up_check"] == "start_up_check"


def test_the_simulated_boards_are_delayed_by_other_work_no_more_than_the_driver():
    """Else a busy computer looks like a broken sensor."""
    for node in (*(nodes(ROBOT)[each] for each in DRIVERS), nodes(SIMULATION)["pam_sim"]):
        assert of_the_driver(node)["realtime_priority"] == "realtime_priority"
    defaults = {
        arguments(name)["realtime_priority"]["default_value"] for name in (ROBOT, SIMULATION)
    }
    assert defaults == {"20"}


def ending(package: str, choice: str, code: int, *, ends_anyway: bool = False) -> Any:
    """What robot.launch.py does when the process of the driver ends with this code."""
    handlers = all_of("OnProcessExit", description(ROBOT))
    assert {each["target_action"]["package"] for each in handlers} == set(DRIVERS)
    (handler,) = (each for each in handlers if each["target_action"]["package"] == package)
    context = SimpleNamespace(
        is_shutdown=ends_anyway, launch_configurations={"on_driver_exit": choice}
    )
    return handler["on_exit"](SimpleNamespace(returncode=code), context)


@EVERY_DRIVER
def test_all_nodes_end_with_the_driver(package):
    assert arguments(ROBOT)["on_driver_exit"]["default_value"] == "shutdown"
    for code in (0, 1, -9):
        made = ending(package, "shutdown", code)
        (shutdown,) = all_of("Shutdown", made)
        assert str(code) in shutdown["reason"]
        assert not all_of("Node", made)


@EVERY_DRIVER
def test_a_driver_that_is_started_again_waits_to_be_activated_by_hand(package):
    made = ending(package, "restart", -9)
    assert not all_of("Shutdown", made)
    (driver,) = all_of("Node", made)
    assert driver["package"] == package
    told = of_the_driver(driver)
    assert str(told["autostart"]).lower() == "false"
    assert str(told["activate_on_start"]).lower() == "false"
    assert told["bus.port"] == "bus_port"
    assert plain(driver["namespace"]) == "namespace"
    (handler,) = all_of("OnProcessExit", made)
    assert handler["target_action"] is driver, "a second end would not be noticed"


@EVERY_DRIVER
def test_a_driver_that_cannot_start_is_not_started_again(package):
    made = ending(package, "restart", 2)
    assert all_of("Shutdown", made)
    assert not all_of("Node", made)


def test_model_and_controller_are_started_again_if_asked_and_the_driver_never_that_way():
    assert arguments(ROBOT)["respawn"]["default_value"] == "false"
    for package, node in nodes(ROBOT).items():
        if package in DRIVERS:
            assert "respawn" not in node.words, "on_driver_exit decides, without autostart"
        else:
            assert plain(node["respawn"]) == "respawn"


def frames(monkeypatch: pytest.MonkeyPatch, *, installed: bool, urdf: str = "") -> Any:
    """What robot.launch.py starts for the frames, with and without robot_state_publisher."""
    made = run_launch_file(FOLDER / ROBOT)
    functions = [
        one["function"] for one in all_of("OpaqueFunction", made["generate_launch_description"]())
    ]
    (function,) = (one for one in functions if one.__name__ == "publish_frames")

    def prefix(name: str) -> str:
        if not installed:
            raise PackageNotFoundError(name)
        return "/opt/ros/jazzy"

    monkeypatch.setitem(function.__globals__, "get_package_prefix", prefix)
    return function(SimpleNamespace(launch_configurations={"urdf": urdf}))


def test_frames_are_published_where_robot_state_publisher_is_installed(monkeypatch):
    made = frames(monkeypatch, installed=True)
    (node,) = all_of("Node", made)
    assert node["package"] == "robot_state_publisher"
    assert plain(node["namespace"]) == "namespace"
    (command,) = all_of("Command", made)
    words = "".join(plain(part) for part in command.given[0])
    assert words.endswith(" -m pam_model urdf --rig 'rig_file'")
    (command,) = all_of("Command", frames(monkeypatch, installed=True, urdf="/a b/arm.urdf"))
    assert "".join(command.given[0]) == "cat '/a b/arm.urdf'"


def test_without_robot_state_publisher_the_log_says_so(monkeypatch):
    made = frames(monkeypatch, installed=False)
    assert not all_of("Node", made)
    (said,) = all_of("LogInfo", made)
    assert "robot_state_publisher is not installed" in said["msg"]


def test_a_misspelt_argument_does_not_start_the_robot_with_the_default():
    """Launch ignores it: `bus_chanel:=can1` would drive the robot on can0."""
    made = run_launch_file(FOLDER / ROBOT)
    check = made["check_words"]
    described = all_of("OpaqueFunction", made["generate_launch_description"]())
    assert described[0]["function"].__name__ == "check_words"
    assert check(SimpleNamespace(argv=["rig_file:=a.yaml", "bus_channel:=can1"])) == []
    for wrong, meant in (("bus_chanel", "bus_channel"), ("rigfile", "rig_file")):
        with pytest.raises(ValueError, match=f"called {wrong}; did you mean {meant}"):
            check(SimpleNamespace(argv=[f"{wrong}:=x"]))
    (said,) = check(SimpleNamespace(argv=["of_another_file:=x"]))
    assert "of_another_file" in said["msg"]


@EVERY_DRIVER
@pytest.mark.parametrize("choice", ["shutdown", "restart"])
def test_a_driver_that_ends_with_the_launch_is_left_alone(package, choice):
    assert not ending(package, choice, 0, ends_anyway=True)


def test_the_viewer_is_started_when_it_is_asked_for():
    assert arguments(ROBOT)["view"]["default_value"] == "false"
    (viewer,) = all_of("ExecuteProcess", description(ROBOT))
    (condition,) = all_of("IfCondition", viewer["condition"])
    assert plain(condition.given[0]) == "view"
    words = viewer["cmd"]
    assert words[1:4] == ["-m", "pam_bringup", "--rig"]
    assert plain(words[4]) == "rig_file"
    assert [plain(part) for part in words[5]] == ["--namespace=", "namespace"]
