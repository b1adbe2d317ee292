"""The topics and services that each node may use, as data and as an SROS 2 policy file.

`pam bringup security config/security_policy.xml` writes the policy (schema 0.2.0 of sros2).
docs/security.md explains how to enable it. `pam bringup security-check` compares it with
what running nodes really use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH
from pam_driver.driver_parameters import PEOPLE_TOPICS
from pam_driver.safety.people_inputs import FULL_SPEED
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig

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


@dataclass(frozen=True, slots=True)
class Rights:
    """Permissions of one node; names have no leading slash, `{muscle}` stands for each muscle."""

    # publishes, subscribes, serves, calls: names in addition to those of every node
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    # actions that the node may serve; it has them where their packages are installed
    actions: tuple[str, ...] = ()


POLICY: Mapping[str, Rights] = {
    "pam_driver": Rights(
        publishes=(
            "pressure_states", "joint_states", "sent_valve_commands", "{muscle}/pressure",
            "diagnostics", "~/transition_event", "~/state", "~/lamp",
        ),
        subscribes=("valve_commands",),
        serves=("~/vent", "~/clear_faults", *_LIFECYCLE_SERVES),
    ),
    "pam_controller": Rights(
        publishes=("valve_commands", "~/reference", "~/error", "~/disturbance", "diagnostics"),
        subscribes=(
            "~/joint_trajectory", "~/commands", "~/stiffness_commands", "~/torque_commands",
            "joint_states", "pressure_states", "pam_driver/state",
        ),
        serves=("~/stop", "~/lower", "~/save_adapted_rig"),
        actions=("~/follow_joint_trajectory",),
        calls=("pam_driver/vent",),
    ),
    "pam_model": Rights(
        publishes=("muscle_states", "joint_estimates", "joint_stiffness", "diagnostics"),
        subscribes=("pressure_states", "joint_states"),
    ),
    "pam_rig": Rights(
        publishes=(
            "ground_truth/joint_states", "ground_truth/muscle_states",
            "ground_truth/pressure_states", "ground_truth/supply_pressure", "diagnostics",
        ),
        subscribes=("~/inject_fault",),
        serves=("~/mend_faults",),
    ),
}  # fmt: skip


def rights_of(node: str, rig: Rig) -> dict[str, set[str]]:
    """Full names by kind: "publish", "subscribe", "reply", "request", "execute" of an action."""
    rights, muscles = POLICY[node], rig.muscle_names
    subscribes = set(rights.subscribes)
    if node == "pam_driver":
        wanted = {
            EMERGENCY_STOP: rig.people.emergency_stop_topic,
            ENABLING_SWITCH: rig.people.enabling_switch_topic,
            FULL_SPEED: rig.people.full_speed_topic,
        }
        subscribes |= {topic for name, topic in PEOPLE_TOPICS.items() if wanted[name]}
    publishes = {*rights.publishes, *_COMMON_PUBLISHES, "parameter_events"}
    serves = {*rights.serves, *_COMMON_SERVES, "~/get_type_description"}

    def full(names: set[str]) -> set[str]:
        found = set()
        for name in names:
            many = [name.format(muscle=muscle) for muscle in muscles] if "{" in name else [name]
            found |= {f"/{one.replace('~', node)}" for one in many}
        return found

    return {
        "publish": full(publishes),
        "subscribe": full(subscribes),
        "reply": full(serves),
        "request": full(set(rights.calls)),
        "execute": full(set(rights.actions)),
    }


def policy_xml(rig: Rig) -> str:
    """The policy file: an enclave for each process, a profile for each node."""
    root = ElementTree.Element("policy", version="0.2.0")
    enclaves = ElementTree.SubElement(root, "enclaves")
    for node in POLICY:
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
