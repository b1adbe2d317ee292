"""The demo reads recordings in which a joint was not measured all the time."""

from __future__ import annotations

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from pam_demo.recording import read_series


def test_a_joint_that_joint_states_leaves_out_for_a_while_is_missing_then(tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    kind, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    samples = [(["a", "b"], [1.0, 2.0]), (["b"], [3.0]), ([], []), (["a", "b"], [4.0, 5.0])]
    with Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/joint_states", kind.__msgtype__, typestore=store)
        for number, (names, positions) in enumerate(samples, 1):
            values, none = np.array(positions), np.array([])
            message = kind(header(stamp(number, 0), ""), names, values, none, none)
            data = store.serialize_cdr(message, kind.__msgtype__)
            writer.write(connection, number * 10**9, data)
    columns = [f"/joint_states.position.{name}" for name in ("a", "b")]
    a, b = read_series(tmp_path / "bag", columns).values()
    assert (a.times.tolist(), a.values.tolist()) == ([1.0, 4.0], [1.0, 4.0])
    assert (b.times.tolist(), b.values.tolist()) == ([1.0, 2.0, 4.0], [2.0, 3.0, 5.0])
    assert a.during(3.0, 2.0).times.tolist() == [1.0]
