"""The layouts for other programs name topics, joints and muscles that exist."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from pam_bringup.security.policy import POLICY, rights_of
from pam_control.actions.follow_trajectory import NAME as ACTION
from pam_control.controller_help import HELP as CONTROLLER
from pam_driver.driver_parameters import HELP as DRIVER
from pam_model.rig import load_rig
from pam_model.robot import compose
from pam_model.views.urdf import robot_as_urdf

ROOT = Path(__file__).parents[2]
LAYOUTS = ROOT / "src/pam_bringup/layouts"
RIG = load_rig(ROOT / "config/elbow.yaml")
NAMES = {*RIG.joint_names, *RIG.muscle_names}
GAP_MONITOR = "pam_gap"
ROBOT_STATE_PUBLISHER = "/robot_description"


def known_topics() -> set[str]:
    """All topics that a node of the suite publishes or hears."""
    kinds = ("publish", "subscribe")
    return {name for node in POLICY for kind in kinds for name in rights_of(node, RIG)[kind]}


def foxglove() -> dict:
    return json.loads((LAYOUTS / "foxglove.json").read_text())


def test_plotjuggler_draws_topics_joints_and_muscles_that_exist():
    tree = ElementTree.parse(LAYOUTS / "plotjuggler.xml")
    curves = [str(curve.get("name")) for curve in tree.iter("curve")]
    assert len(curves) > 8
    for curve in curves:
        of_states = re.fullmatch(r"(/.+)/(\w+)/(position|velocity|effort)", curve)
        if of_states:
            assert of_states[2] in NAMES, curve
        topic = of_states[1] if of_states else curve.rpartition("/data[")[0]
        assert topic in known_topics(), curve


def test_foxglove_draws_topics_that_exist_and_every_panel_is_placed():
    layout = foxglove()
    plots = [entry for name, entry in layout["configById"].items() if name.startswith("Plot!")]
    for path in [line["value"] for plot in plots for line in plot["paths"]]:
        topic, field = re.fullmatch(r"(/[\w/]+)\.(\w+)\[\d\]", path).groups()
        assert topic in known_topics(), path
        assert field in {"position", "effort", "data"}
    assert set(layout["configById"]["3D!pam"]["topics"]) == {ROBOT_STATE_PUBLISHER}
    assert layout["configById"]["DiagnosticSummary!pam"]["topicToRender"] in known_topics()
    state = layout["configById"]["RawMessages!pam"]["topicPath"]
    assert state.removesuffix(".message") in known_topics()
    vent = layout["configById"]["CallService!vent"]["serviceName"]
    assert vent in rights_of("pam_driver", RIG)["reply"]
    placed: list[str] = []

    def collect(part):
        if isinstance(part, str):
            placed.append(part)
        else:
            collect(part["first"])
            collect(part["second"])

    collect(layout["layout"])
    assert sorted(placed) == sorted(layout["configById"])


def test_rviz_shows_the_robot_in_the_first_frame_of_its_urdf():
    config = yaml.safe_load((LAYOUTS / "robot.rviz").read_text())["Visualization Manager"]
    frame = config["Global Options"]["Fixed Frame"]
    assert f'link name="{frame}"' in robot_as_urdf(compose(RIG), "elbow")
    (model,) = [d for d in config["Displays"] if d["Class"].endswith("RobotModel")]
    assert model["Description Topic"]["Value"] == ROBOT_STATE_PUBLISHER


@pytest.mark.parametrize("node", [*POLICY, GAP_MONITOR])
def test_the_aggregator_has_a_group_for_every_node_with_diagnostics(node):
    tree = yaml.safe_load((LAYOUTS / "diagnostic_aggregator.yaml").read_text())
    groups = [g for g in tree["/**"]["ros__parameters"].values() if isinstance(g, dict)]
    if node in POLICY and "/diagnostics" not in rights_of(node, RIG)["publish"]:
        return
    for name in (f"{node}: loop", f"robot1/{node}: loop"):
        assert [g["path"] for g in groups if any(text in name for text in g["contains"])]


def test_moveit_calls_the_action_of_the_controller_for_the_joints_of_the_rig():
    tree = yaml.safe_load((ROOT / "config/moveit_controllers.yaml").read_text())
    manager = tree["moveit_simple_controller_manager"]
    (name,) = manager["controller_names"]
    entry = manager[name]
    assert entry["type"] in next(e.kind for e in CONTROLLER.serves if e.name == ACTION)
    assert f"~/{entry['action_ns']}" == ACTION
    assert name in POLICY
    assert entry["joints"] == list(RIG.joint_names)
    assert any(endpoint.name == "joint_states" for endpoint in DRIVER.publishes)
