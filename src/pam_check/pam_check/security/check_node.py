"""Holds the policy of `security_policy` against what the nodes of a chain really use."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import rclpy
from rclpy.node import Node

from pam_check.chain import MODULES, Chain, multicast_bus, private_domain, set_environment
from pam_check.security.policy import POLICY, rights_of
from pam_model.rig import load_rig

PATIENCE = 40.0  # s


def used_by(node: Node, name: str) -> dict[str, set[str]]:
    """What a running node publishes, hears and serves."""
    return {
        "publish": {topic for topic, _ in node.get_publisher_names_and_types_by_node(name, "/")},
        "subscribe": {topic for topic, _ in node.get_subscriber_names_and_types_by_node(name, "/")},
        "reply": {service for service, _ in node.get_service_names_and_types_by_node(name, "/")},
    }


def differences(rig_path: Path) -> list[str]:
    """One line for each name that is used but not allowed, or allowed but not used."""
    environment = private_domain()
    muscles = load_rig(rig_path).muscle_names
    with set_environment(environment):
        rclpy.init(args=[])
    node = rclpy.create_node("security_check")
    try:
        with Chain([rig_path], multicast_bus(), environment) as chain:
            for module in MODULES:
                chain.start(module)
            end = time.monotonic() + PATIENCE
            while True:
                chain.check()
                found = _compare(node, muscles)
                if not found or time.monotonic() > end:
                    return found
                rclpy.spin_once(node, timeout_sec=0.3)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _compare(node: Node, muscles: tuple[str, ...]) -> list[str]:
    present = set(node.get_node_names())
    lines = [f"{name}: does not run" for name in POLICY if name not in present]
    for name in POLICY:
        if name not in present:
            continue
        used, allowed = used_by(node, name), rights_of(name, muscles)
        for kind in used:
            lines += [f"{name} {kind} {one}: used" for one in sorted(used[kind] - allowed[kind])]
            lines += [f"{name} {kind} {one}: unused" for one in sorted(allowed[kind] - used[kind])]
    return lines


def main() -> int:
    """Print the differences; 0 if there are none."""
    lines = differences(Path(sys.argv[1] if len(sys.argv) > 1 else "config/elbow.yaml"))
    print("\n".join(lines) or "the policy is what the nodes use")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
