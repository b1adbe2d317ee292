"""The topics and services that each node may use, as an SROS 2 policy file.

`pam bringup security config/security_policy.xml` writes the policy (schema 0.2.0 of sros2).
docs/security.md explains how to enable it. `pam bringup security-check` compares it with
what running nodes really use.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final
from xml.etree import ElementTree

from pam_control.controller_help import HELP as CONTROLLER
from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH
from pam_driver.driver_parameters import HELP as DRIVER
from pam_driver.driver_parameters import PEOPLE_TOPICS
from pam_driver.safety.people_inputs import FULL_SPEED
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.model_help import HELP as MODEL
from pam_model.rig import Rig, load_rig
from pam_ros.node_help import NodeHelp
from pam_sim.rig_help import HELP as SIMULATED_RIG

# Topics and services that ROS gives to every node; `~` is the node's own name.
_COMMON_PUBLISHES = ("rosout", "parameter_events")
_COMMON_SERVES = tuple(
    f"~/{name}"
    for name in (
        "describe_parameters", "get_parameter_types", "get_parameters", "list_parameters",
        "set_parameters", "set_parameters_atomically", "get_type_description",
    )
)  # fmt: skip
_LIFECYCLE_SERVES = tuple(
    f"~/{name}"
    for name in (
        "change_state", "get_state", "get_available_states", "get_available_transitions",
        "get_transition_graph",
    )
)  # fmt: skip


NODES: Final[Mapping[str, NodeHelp]] = {
    "pam_driver": DRIVER,
    "pam_controller": CONTROLLER,
    "pam_model": MODEL,
    "pam_rig": SIMULATED_RIG,
}
"""What each node publishes, subscribes to and serves, as its `--help` says."""
_ACTION: Final = "action "


def rights_of(node: str, rig: Rig) -> dict[str, set[str]]:
    """Full names by kind: "publish", "subscribe", "reply", "request", "execute" of an action."""
    told = NODES[node]
    publishes = {one.name for one in told.publishes} | set(_COMMON_PUBLISHES)
    subscribes = {one.name for one in told.subscribes}
    serves = {one.name for one in told.serves if not one.kind.startswith(_ACTION)}
    serves |= set(_COMMON_SERVES)
    if node == "pam_driver":
        wanted = {
            EMERGENCY_STOP: rig.people.emergency_stop_topic,
            ENABLING_SWITCH: rig.people.enabling_switch_topic,
            FULL_SPEED: rig.people.full_speed_topic,
        }
        subscribes -= {topic for name, topic in PEOPLE_TOPICS.items() if not wanted[name]}
        publishes.add("~/transition_event")
        serves |= set(_LIFECYCLE_SERVES)

    def full(names: set[str]) -> set[str]:
        of_all = {
            name.replace("<muscle>", muscle).replace("~", node).lstrip("/")
            for name in names
            for muscle in rig.muscle_names
        }
        return {f"/{name}" for name in of_all}

    return {
        "publish": full(publishes),
        "subscribe": full(subscribes),
        "reply": full(serves),
        "request": full({"pam_driver/vent"} if node == "pam_controller" else set()),
        # the node has it where the package of the action is installed
        "execute": full({one.name for one in told.serves if one.kind.startswith(_ACTION)}),
    }


def policy_xml(rig: Rig) -> str:
    """The policy file: an enclave for each process, a profile for each node."""
    root = ElementTree.Element("policy", version="0.2.0")
    enclaves = ElementTree.SubElement(root, "enclaves")
    for node in NODES:
        enclave = ElementTree.SubElement(enclaves, "enclave", path=f"/{node}")
        profiles = ElementTree.SubElement(enclave, "profiles")
        profile = ElementTree.SubElement(profiles, "profile", ns="/", node=node)
        rights = rights_of(node, rig)
        for kind, tag in (
            ("reply", "service"), ("request", "service"), ("subscribe", "topic"),
            ("publish", "topic"), ("execute", "action"),
        ):  # fmt: skip
            if not rights[kind]:
                continue
            group = ElementTree.SubElement(profile, f"{tag}s", {kind: "ALLOW"})
            for name in sorted(rights[kind]):
                ElementTree.SubElement(group, tag).text = name
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def run(given: Arguments) -> Outcome:
    """Write the policy of a rig; the command `pam bringup security`.

    Raises
    ------
    PamError
        For a rig that cannot be used.
    """
    rig = load_rig(chosen_rig(given))
    make_parents(given.file).write_text(policy_xml(rig), encoding="utf-8")
    print(f"written: {given.file}")
    return Outcome({"file": given.file, "muscles": rig.muscle_names})
