"""A rig with both kinds of valve at work, and what its driver publishes meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from pam_check.faults.chain import STEP, FaultChain
from support.rigs import CONFIG

TWO_JOINTS = CONFIG / "two_joints.yaml"
"""Flow valves at the shoulder, pressure regulators at the elbow."""


@dataclass(frozen=True)
class Heard:
    """What one cycle of the driver publishes; each row is name, position, velocity, effort."""

    time: float
    topics: dict[str, tuple[tuple[str, ...], list[float], list[float], list[float]]]


def drive(chain: FaultChain, seconds: float) -> list[Heard]:
    """Let the chain run, and hear what the driver node would publish, 500 times a second."""
    rig, heard = chain.rig, []
    for tick in range(round(seconds / STEP)):
        chain.step()
        seen = chain.published
        if tick % 2 or seen is None or not seen.sent:
            continue
        position, effort = chain.driver.intake.in_units(seen.sent)
        topics = {
            "sent_valve_commands": (rig.muscle_names, position, [], effort),
            "pressure_states": (rig.muscle_names, [], [], list(seen.pressures)),
            "joint_states": (rig.joint_names, list(seen.positions), list(seen.velocities), []),
        }
        heard.append(Heard(chain.wall, topics))
    return heard


def write_bag(path: Path, heard: list[Heard]) -> Path:
    """A rosbag2 folder, as a recorder leaves it."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind: Any = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        links = {
            topic: writer.add_connection(f"/{topic}", kind.__msgtype__, typestore=store)
            for topic in heard[0].topics
        }
        for entry in heard:
            now = round(entry.time * 1e9)
            at = header(stamp(now // 10**9, now % 10**9), "")
            for topic, (names, *fields) in entry.topics.items():
                message = kind(at, list(names), *(np.asarray(f, dtype=float) for f in fields))
                writer.write(links[topic], now, store.serialize_cdr(message, kind.__msgtype__))
    return path
