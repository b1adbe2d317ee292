"""The SROS 2 policy: as its table says, as its file says, as the nodes do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from pam_bringup.security import check_node as security_check_node
from pam_bringup.security.policy import NODES, policy_xml, rights_of
from pam_model.rig import load_rig
from support.rigs import ELBOW

RIG = load_rig(ELBOW)
FILE = Path(__file__).parents[2] / "config/security_policy.xml"


def test_the_file_is_written_from_what_the_nodes_say():
    assert FILE.read_text(encoding="utf-8") == policy_xml(RIG)


def test_every_node_has_one_profile_and_nothing_is_allowed_by_wildcard():
    root = ElementTree.fromstring(policy_xml(RIG))
    assert [profile.get("node") for profile in root.iter("profile")] == list(NODES)
    tags = ("topic", "service", "action")
    names = [entry.text or "" for tag in tags for entry in root.iter(tag)]
    assert names
    assert not [name for name in names if "*" in name or not name.startswith("/")]


def test_only_the_controller_commands_valves():
    commanders = [n for n in NODES if "/valve_commands" in rights_of(n, RIG)["publish"]]
    assert commanders == ["pam_controller"]


def test_the_topics_of_people_are_allowed_where_the_rig_file_asks_for_them():
    asking = replace(RIG, people=replace(RIG.people, emergency_stop_topic=True))
    stop = "/pam_driver/emergency_stop_released"
    assert stop in rights_of("pam_driver", asking)["subscribe"]
    assert stop not in rights_of("pam_driver", RIG)["subscribe"]


def test_the_policy_is_what_the_nodes_use():
    assert security_check_node.differences(ELBOW) == []


def test_a_name_too_many_and_one_too_few_are_found(monkeypatch):
    class Graph:
        def get_node_names(self):
            return list(NODES)

        def get_publisher_names_and_types_by_node(self, name, space):
            return [("/secret", [])] if name == "pam_model" else []

        def get_subscriber_names_and_types_by_node(self, name, space):
            return []

        def get_service_names_and_types_by_node(self, name, space):
            served = {"pam_controller": "follow_joint_trajectory", "pam_rig": "secret"}.get(name)
            return [(f"/{name}/{served}/_action/send_goal", [])] if served else []

    lines = security_check_node._compare(Graph(), RIG)
    assert "pam_model publish /secret: used" in lines
    assert "pam_driver reply /pam_driver/vent: unused" in lines
    assert "pam_rig execute /pam_rig/secret: used" in lines
    assert not [line for line in lines if "follow_joint_trajectory" in line]
