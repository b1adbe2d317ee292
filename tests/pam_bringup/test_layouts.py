"""The layouts for other programs name topics, joints and muscles that exist."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from pam_bringup.__main__ import main as bringup
from pam_bringup.layouts.foxglove import foxglove_layout
from pam_bringup.layouts.plotjuggler import plotjuggler_layout
from pam_bringup.layouts.plots import plots_of
from pam_bringup.security.policy import NODES, rights_of
from pam_control.actions.follow_trajectory import NAME as ACTION
from pam_control.controller_help import HELP as CONTROLLER
from pam_driver.driver_parameters import HELP as DRIVER
from pam_model.model_help import HELP as MODEL
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose
from pam_model.views.urdf import robot_as_urdf

ROOT = Path(__file__).parents[2]
LAYOUTS = ROOT / "src/pam_bringup/layouts"
RIG = load_rig(ROOT / "config/elbow.yaml")
GAP_MONITOR = "pam_gap"
ROBOT_STATE_PUBLISHER = "/robot_description"


LAYOUTS_OF = {"foxglove.json": foxglove_layout, "plotjuggler.xml": plotjuggler_layout}
RIGS = {name: load_rig(ROOT / f"config/{name}.yaml") for name in (
    "elbow", "two_joints", "elbow_canopen_regulator"
)}  # fmt: skip
FIELDS = {"sensor_msgs/JointState": {"position", "velocity", "effort"},
          "std_msgs/Float64MultiArray": {"data"}}  # fmt: skip


def arm(count: int) -> Rig:
    """A robot of many joints, the last one without an encoder and the others numbered."""
    joints, muscles = [], []
    for number in range(count):
        names = [f"{name}{number}" for name in RIG.muscle_names]
        encoder = None if number == count - 1 else RIG.joints[0].encoder
        joints.append(replace(RIG.joints[0], name=f"joint{number}", muscles=tuple(names),
                              encoder=encoder))  # fmt: skip
        muscles += [replace(each, name=name) for each, name in zip(RIG.muscles, names, strict=True)]
    return replace(RIG, joints=tuple(joints), muscles=tuple(muscles))


EVERY_RIG = {**RIGS, "seven joints": arm(7)}
each_rig = pytest.mark.parametrize("rig", EVERY_RIG.values(), ids=EVERY_RIG)
each_prefix = pytest.mark.parametrize("prefix", ["", "/left"])


def kinds(rig: Rig, prefix: str) -> dict[str, str]:
    """Types of all topics that nodes of the suite publish or hear, as their `--help` tells them.

    tests/system compares these lists with running nodes.
    """
    found = {}
    for node, text in {"pam_driver": DRIVER, "pam_controller": CONTROLLER,
                       "pam_model": MODEL}.items():  # fmt: skip
        rights = rights_of(node, rig)
        for entry in (*text.publishes, *text.subscribes):
            name = "/" + entry.name.replace("~", node).lstrip("/")
            if name in rights["publish"] | rights["subscribe"]:
                found[name if name == "/diagnostics" else prefix + name] = entry.kind
    return found


@pytest.mark.parametrize("name", LAYOUTS_OF)
def test_the_installed_layouts_are_those_of_the_example(name):
    """`./pam bringup layouts src/pam_bringup/layouts --rig config/elbow.yaml` renews them."""
    assert (LAYOUTS / name).read_text() == LAYOUTS_OF[name](RIG)


@each_rig
@each_prefix
def test_plotjuggler_draws_each_number_of_each_joint_by_its_name(rig, prefix):
    tree = ElementTree.fromstring(plotjuggler_layout(rig, prefix))
    assert [tab.get("tab_name") for tab in tree.iter("Tab")] == list(rig.joint_names)
    known, drawn = kinds(rig, prefix), set()
    for curve in tree.iter("curve"):
        named = re.fullmatch(r"(/.+)/(\w+)/(position|velocity|effort)", curve.get("name"))
        numbered = re.fullmatch(r"(/.+)/(data)\[(\d+)\]", curve.get("name"))
        if named:
            assert named[2] in {*rig.joint_names, *rig.muscle_names}
            assert known[named[1]] == "sensor_msgs/JointState"
            drawn.add(named[2])
        else:
            assert known[numbered[1]] == "std_msgs/Float64MultiArray"
            assert int(numbered[3]) < len(rig.joints)
    assert drawn == {*rig.joint_names, *rig.muscle_names}
    for box in tree.iter("DockSplitter"):
        assert len(box) == int(box.get("count")) == len(box.get("sizes").split(";")) > 0


@each_rig
@each_prefix
def test_foxglove_draws_topics_that_exist_and_every_panel_is_placed(rig, prefix):
    layout = json.loads(foxglove_layout(rig, prefix))
    panels, known = layout["configById"], kinds(rig, prefix)
    tabs = panels["Tab!joints"]["tabs"]
    assert [tab["title"] for tab in tabs] == list(rig.joint_names)
    for path in [line["value"] for name, plot in panels.items() if name[:4] == "Plot"
                 for line in plot["paths"]]:  # fmt: skip
        topic, field, place = re.fullmatch(r"(/[\w/]+)\.(\w+)\[(\d+)\]", path).groups()
        assert field in FIELDS[known[topic]], path
        many = rig.muscle_names if re.search("pressure|valve|muscle", topic) else rig.joint_names
        assert int(place) < len(many), path
    assert set(panels["3D!pam"]["topics"]) == {prefix + ROBOT_STATE_PUBLISHER}
    assert panels["DiagnosticSummary!pam"]["topicToRender"] in known
    assert panels["RawMessages!pam"]["topicPath"].removesuffix(".message") in known
    vent = panels["CallService!vent"]["serviceName"]
    assert vent.removeprefix(prefix) in rights_of("pam_driver", rig)["reply"]
    placed: list[str] = []

    def collect(part):
        if isinstance(part, str):
            placed.append(part)
        else:
            collect(part["first"])
            collect(part["second"])

    for tree in (layout["layout"], *(tab["layout"] for tab in tabs)):
        collect(tree)
    assert sorted(placed) == sorted(panels)


def test_each_curve_is_at_the_place_of_its_joint_or_muscle():
    """Foxglove reads by place: two joints, of which the first one has no encoder."""
    one, two = RIGS["two_joints"].joints
    rig = RIGS["two_joints"].with_joint(replace(one, encoder=None))
    curves = {(curve.topic, curve.field, curve.label): curve.place
              for plot in plots_of(rig, two) for curve in plot.curves}  # fmt: skip
    assert curves["/joint_states", "position", "measured"] == 0  # the only one that is measured
    assert curves["/pam_controller/reference", "position", "reference"] == 1
    assert curves["/joint_stiffness", "data", "given"] == 1
    assert curves["/pressure_states", "effort", "elbow_extensor"] == 3
    # the elbow has regulators: they are sent pressures, and have no opening
    assert curves["/sent_valve_commands", "effort", "elbow_flexor, asked for"] == 2
    assert ("/sent_valve_commands", "position", "elbow_flexor") not in curves
    assert any("opening" in plot.title for plot in plots_of(rig, one))


def test_the_command_writes_a_layout_for_each_program(tmp_path, capsys):
    rig = str(ROOT / "config/two_joints.yaml")
    words = ["layouts", str(tmp_path / "new"), "--rig", rig, "--namespace", "/left/"]
    assert bringup(words) == 0
    for name, made in LAYOUTS_OF.items():
        assert (tmp_path / "new" / name).read_text() == made(RIGS["two_joints"], "/left")
    told = capsys.readouterr().out
    assert all(name in told for name in LAYOUTS_OF)


def test_rviz_shows_the_robot_in_the_first_frame_of_its_urdf():
    config = yaml.safe_load((LAYOUTS / "robot.rviz").read_text())["Visualization Manager"]
    frame = config["Global Options"]["Fixed Frame"]
    assert f'link name="{frame}"' in robot_as_urdf(compose(RIG), "elbow")
    (model,) = [d for d in config["Displays"] if d["Class"].endswith("RobotModel")]
    assert model["Description Topic"]["Value"] == ROBOT_STATE_PUBLISHER


@pytest.mark.parametrize("node", [*NODES, GAP_MONITOR])
def test_the_aggregator_has_a_group_for_every_node_with_diagnostics(node):
    tree = yaml.safe_load((LAYOUTS / "diagnostic_aggregator.yaml").read_text())
    groups = [g for g in tree["/**"]["ros__parameters"].values() if isinstance(g, dict)]
    if node in NODES and "/diagnostics" not in rights_of(node, RIG)["publish"]:
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
    assert name in NODES
    assert entry["joints"] == list(RIG.joint_names)
    assert any(endpoint.name == "joint_states" for endpoint in DRIVER.publishes)
