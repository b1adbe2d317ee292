"""Bytes that are no message are refused before anything is made of them."""

from __future__ import annotations

import random
import struct
import time
import tracemalloc
from typing import Any

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory

from pam_check.fuzz.message_bytes import MUTATIONS, drawn
from pam_ros.errors import MalformedMessageError
from pam_ros.message_decoder import checked, decode
from pam_ros.subscriptions import MOST_BYTES, GuardedTopic

KINDS = (
    Bool, String, Float64MultiArray, FluidPressure, JointState, DiagnosticStatus, DiagnosticArray,
    JointTrajectory,
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(20))
def test_every_message_is_read(kind: Any, seed: int) -> None:
    message = drawn(kind, random.Random(seed))
    data = bytes(serialize_message(message))
    assert repr(decode(data, kind)) == repr(message)
    assert checked(data + b"\0\0\0", kind).startswith(data), "what follows is padding"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mutation", MUTATIONS)
def test_spoilt_bytes_are_read_or_refused(
    kind: Any, mutation: str, capfd: pytest.CaptureFixture[str]
) -> None:
    for seed in range(30):
        draw = random.Random(seed)
        data = MUTATIONS[mutation](bytes(serialize_message(drawn(kind, draw))), draw)
        try:
            decode(data, kind)
        except MalformedMessageError as error:
            assert len(str(error)) < 100
        else:
            assert mutation not in {"nothing", "less than a header", "header only"}
    assert capfd.readouterr().err == "", "the middleware writes lines of its own"


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        (Bool, b"\0\1\0\0"),
        (Bool, b"\0\1\0\0\5"),
        (Bool, b"\0\7\0\0\1"),  # another layout, in which rclpy reads True
        (Bool, b"\x55\1\0\0\1"),
        (Bool, b""),
        (String, b"\0\1\0\0" + struct.pack("<I", 2**32 - 1)),
        (String, b"\0\0\0\0" + struct.pack("<I", 1) + b"\0"),  # the count in the other order
        (JointState, b"\0\1\0\0" + bytes(8) + struct.pack("<III", 1, 0, 2**31)),
        (Float64MultiArray, b"\0\1\0\0" + struct.pack("<II", 2**30, 0)),
    ],
)
def test_what_is_not_a_message_is_refused(kind: Any, data: bytes) -> None:
    with pytest.raises(MalformedMessageError):
        decode(data, kind)


def test_a_message_in_the_other_byte_order_is_read() -> None:
    assert decode(b"\0\0\0\0" + struct.pack(">I", 3) + b"ab\0", String).data == "ab"


@pytest.mark.parametrize("kind", KINDS)
def test_a_huge_count_costs_no_memory(kind: Any) -> None:
    data = bytearray(serialize_message(drawn(kind, random.Random(1))))
    tracemalloc.start()
    try:
        for place in range(4, len(data) - 4, 4):
            broken = data[:place] + struct.pack("<I", 2**31 - 1) + data[place + 4 :]
            try:
                decode(bytes(broken), kind)
            except MalformedMessageError:
                continue
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "message",
    [
        JointState(name=[f"n{number}" for number in range(100_000)]),
        JointState(name=["x" * 100_000, "elbow"], position=[0.0, 0.0]),
        JointState(name=["elbow"], position=[0.0] * 100_000),
    ],
)
def test_a_message_that_is_too_large_is_not_looked_at(message: Any) -> None:
    data = bytes(serialize_message(message))
    assert len(data) > MOST_BYTES
    guarded = GuardedTopic("/joint_states", pytest.fail, pytest.fail, None, MOST_BYTES)
    began = time.perf_counter()
    guarded(data)
    assert time.perf_counter() - began < 1e-3
    assert guarded.count == 1
    assert guarded.last[0] == f"{len(data)} bytes, expected at most {MOST_BYTES}"
