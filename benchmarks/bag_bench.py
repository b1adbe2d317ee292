"""Messages per second of the import of a bag, beside decoding the same messages and nothing else.

    python benchmarks/bag_bench.py [--json] [--check]

The bag holds 40 s at 500 Hz of one joint: pressures, positions and commands. The limit is the
library that reads it (rosbags): it reads and decodes every message, and drops it.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from pam_gap.recordings.import_rosbag import read_rosbag
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command

SAMPLES = 20_000
PERIOD = 2_000_000  # ns
START = 1_700_000_000_000_000_000  # ns
MUSCLES, JOINTS = ["elbow_flexor", "elbow_extensor"], ["elbow"]
REPEATS = 5
GOAL = 0.8


def write_bag(folder: Path) -> None:
    """A bag with three topics of JointState."""
    store = get_typestore(Stores.ROS2_JAZZY)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    none = np.array([])
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            name: writer.add_connection(name, state.__msgtype__, typestore=store)
            for name in ("/pressure_states", "/joint_states", "/sent_valve_commands")
        }
        for sample in range(SAMPLES):
            now = START + PERIOD * sample
            of = header(stamp(now // 1_000_000_000, now % 1_000_000_000), "")
            pair, one = np.array([2e5, 1e5 + sample]), np.array([1e-4 * sample])
            messages = {
                "/pressure_states": state(of, MUSCLES, none, none, pair),
                "/joint_states": state(of, JOINTS, one, one, none),
                "/sent_valve_commands": state(of, MUSCLES, pair * 1e-6, none, none),
            }
            for name, message in messages.items():
                data = store.serialize_cdr(message, state.__msgtype__)
                writer.write(topics[name], now, data)


def decode(folder: Path) -> int:
    """Read and decode every message; return their number."""
    count = 0
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            count += 1
    return count


def processor_time(call: Callable[[], object]) -> float:
    """Processor time of a call [s]."""
    start = time.process_time()
    call()
    return time.process_time() - start


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


def _run(given: Arguments) -> Outcome:
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "bag"
        write_bag(folder)
        messages = decode(folder)
        # in turns, so that the load of the machine disturbs both alike; the best of each counts
        pairs = [
            (processor_time(lambda: decode(folder)), processor_time(lambda: read_rosbag(folder)))
            for _ in range(REPEATS)
        ]
        bare, imported = (messages / min(times) for times in zip(*pairs, strict=True))
    ratio = imported / bare
    print(f"{messages} messages: import {imported:.0f} messages/s, decoding alone {bare:.0f}")
    met = "met" if ratio >= GOAL else "missed"
    print(f"import / decoding: {ratio:.2f}   goal {GOAL:g}: {met}")
    document = {"import_per_second": imported, "decoding_per_second": bare, "ratio": ratio}
    return Outcome(document, [] if ratio >= GOAL else [f"{ratio:.2f} of decoding, goal {GOAL:g}"])


BENCH = Command("bag", "import of a bag beside decoding", _declare, _run, "if the goal is missed")

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/bag_bench.py"))
