"""Compares the policy of `pam_bringup.security` with what the nodes of a chain really use."""

from __future__ import annotations

import time
from pathlib import Path

import rclpy
from rclpy.node import Node

from pam_bringup.security.policy import NODES, rights_of
from pam_demo.chain import Chain, multicast_bus, private_domain, set_environment
from pam_demo.programs import MODULES
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig
from pam_ros.start import start_ros

PATIENCE = 40.0  # s
OF_AN_ACTION = "/_action/"


def used_by(node: Node, name: str) -> dict[str, set[str]]:
    """Topics and services that a running node publishes, subscribes to and serves.

    An action consists of topics and services with names of their own; it counts as one name.
    """
    found = {
        "publish": node.get_publisher_names_and_types_by_node(name, "/"),
        "subscribe": node.get_subscriber_names_and_types_by_node(name, "/"),
        "reply": node.get_service_names_and_types_by_node(name, "/"),
    }
    used = {
        kind: {entry for entry, _ in entries if OF_AN_ACTION not in entry}
        for kind, entries in found.items()
    }
    used["execute"] = {
        entry.split(OF_AN_ACTION)[0] for entry, _ in found["reply"] if OF_AN_ACTION in entry
    }
    return used


def differences(rig_path: Path) -> list[str]:
    """One line for each name that is used but not allowed, or allowed but not used."""
    environment = private_domain()
    rig = load_rig(rig_path)
    with set_environment(environment):
        start_ros([])
    node = rclpy.create_node("security_check")
    try:
        with Chain([rig_path], multicast_bus(), environment) as chain:
            for module in MODULES:
                chain.start(module)
            end = time.monotonic() + PATIENCE
            while True:
                chain.check()
                found = _compare(node, rig)
                if not found or time.monotonic() > end:
                    return found
                rclpy.spin_once(node, timeout_sec=0.3)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _compare(node: Node, rig: Rig) -> list[str]:
    present = set(node.get_node_names())
    lines = [f"{name}: does not run" for name in NODES if name not in present]
    for name in NODES:
        if name not in present:
            continue
        used, allowed = used_by(node, name), rights_of(name, rig)
        for kind in used:
            lines += [f"{name} {kind} {one}: used" for one in sorted(used[kind] - allowed[kind])]
            if kind == "execute":
                continue  # offered only where the package of the action is installed
            lines += [f"{name} {kind} {one}: unused" for one in sorted(allowed[kind] - used[kind])]
    return lines


def run(given: Arguments) -> Outcome:
    """Compare and print the differences; the command `pam bringup security-check`.

    Raises
    ------
    PamError
        For a rig that cannot be used, or a node that ends.
    """
    lines = differences(chosen_rig(given))
    print("\n".join(lines) or "the policy agrees with what the nodes use")
    return Outcome({"differences": lines}, lines)
