"""JointState as bytes: the same as what rclpy writes and reads."""

from __future__ import annotations

import math
import random
import struct

import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from pam_ros.errors import MalformedMessageError
from pam_ros.joint_state_bytes import (
    JointStateReader,
    JointStateWriter,
)

ALPHABET = "abcdefgh_äπ/0123456789"


def drawn(draw: random.Random) -> JointState:
    """A message with names and arrays of any length, with NaN and infinity among the numbers."""

    def text() -> str:
        return "".join(draw.choices(ALPHABET, k=draw.randrange(9)))

    def numbers() -> list[float]:
        special = (math.nan, math.inf, -0.0)
        return [
            draw.choice(special) if draw.random() < 0.2 else draw.gauss(0.0, 1e5)
            for _ in range(draw.randrange(5))
        ]

    message = JointState(name=[text() for _ in range(draw.randrange(5))])
    message.position, message.velocity, message.effort = numbers(), numbers(), numbers()
    message.header.frame_id = text()
    message.header.stamp.sec = draw.randrange(2**31)
    message.header.stamp.nanosec = draw.randrange(10**9)
    return message


def as_tuple(message: object) -> tuple[object, ...]:
    """All fields, with the numbers as bytes, so that NaN equals NaN and -0 differs from 0."""
    numbers = [list(getattr(message, field)) for field in ("position", "velocity", "effort")]
    return list(message.name), [struct.pack(f"{len(each)}d", *each) for each in numbers]  # type: ignore[attr-defined]


def written(writer: JointStateWriter, message: JointState) -> bytes:
    stamp = message.header.stamp
    return writer.write(
        stamp.sec * 10**9 + stamp.nanosec,
        tuple(message.name),
        message.position,
        message.velocity,
        message.effort,
    )


@pytest.mark.parametrize("seed", range(60))
def test_written_bytes_are_the_message_that_rclpy_reads_and_writes(seed: int) -> None:
    message = drawn(random.Random(seed))
    data = written(JointStateWriter(message.header.frame_id), message)
    read = deserialize_message(data, JointState)
    assert as_tuple(read) == as_tuple(message)
    assert read.header == message.header
    # rclpy leaves what was in the memory in the bytes between two fields and after the last one
    other = serialize_message(message)
    pads = padding(message)
    assert len(other) >= len(data)
    compared = [place for place in range(len(data)) if place not in pads]
    assert [data[place] for place in compared] == [other[place] for place in compared]


def padding(message: JointState) -> set[int]:
    """Places of the bytes that have no meaning."""
    found: set[int] = set()
    at = 12

    def align(size: int) -> None:
        nonlocal at
        while (at - 4) % size:
            found.add(at)
            at += 1

    def text(value: str) -> None:
        nonlocal at
        align(4)
        at += 4 + len(value.encode()) + 1

    text(message.header.frame_id)
    align(4)
    at += 4
    for name in message.name:
        text(name)
    for values in (message.position, message.velocity, message.effort):
        align(4)
        at += 4
        if len(values):
            align(8)
            at += 8 * len(values)
    return found


def test_one_writer_writes_messages_of_changing_form() -> None:
    writer, draw = JointStateWriter("arm"), random.Random(7)
    messages = [drawn(draw) for _ in range(20)]
    for message in messages * 2:
        message.header.frame_id = "arm"
        read = deserialize_message(written(writer, message), JointState)
        assert as_tuple(read) == as_tuple(message)


def test_the_memory_of_a_writer_is_bounded_whatever_the_names_are() -> None:
    writer = JointStateWriter()
    for number in range(2000):
        writer.write(0, (str(number),), (1.0,))
    assert len(writer._forms) <= 256


@pytest.mark.parametrize("seed", range(60))
def test_a_reader_reads_what_rclpy_and_the_writer_write(seed: int) -> None:
    draw = random.Random(seed)
    reader = JointStateReader()
    first, second = drawn(draw), drawn(draw)
    for message in (first, first, second, first):
        writer = JointStateWriter(message.header.frame_id)
        for data in (bytes(serialize_message(message)), written(writer, message)):
            fields = reader.read(data)
            assert as_tuple(fields) == as_tuple(message)
            stamp = message.header.stamp
            assert fields[:3] == (stamp.sec, stamp.nanosec, message.header.frame_id)


def test_a_message_of_the_same_names_in_another_order_is_not_taken_for_the_last_one() -> None:
    reader, writer = JointStateReader(), JointStateWriter()
    assert reader.read(writer.write(0, ("ab", "cd"), (1.0, 2.0))).name == ("ab", "cd")
    assert reader.read(writer.write(0, ("cd", "ab"), (1.0, 2.0))).name == ("cd", "ab")
    one_field = reader.read(writer.write(0, ("cd", "ab"), (), (1.0, 2.0)))
    assert one_field.position == ()
    assert one_field.velocity == (1.0, 2.0)


def test_a_big_endian_message_is_read_by_rclpy() -> None:
    parts = (
        b"\0\0\0\0",  # encapsulation: CDR, big-endian
        struct.pack(">iI", 5, 7),
        struct.pack(">I4x", 1),  # the frame: an empty text
        struct.pack(">II2s2x", 1, 2, b"a"),  # one name
        struct.pack(">Id", 1, 2.5),
        struct.pack(">II", 0, 0),
    )
    data = b"".join(parts)
    fields = JointStateReader().read(data)
    assert (fields.name, fields.position, fields.stamp) == (("a",), (2.5,), 5 + 7e-9)


@pytest.mark.parametrize("seed", range(40))
def test_bytes_that_are_no_message_are_refused_and_nothing_else_happens(seed: int) -> None:
    draw = random.Random(seed)
    reader = JointStateReader()
    data = bytes(serialize_message(drawn(draw)))
    reader.read(data)
    for _ in range(50):
        broken = bytearray(data[: draw.randrange(len(data))])
        for _ in range(draw.randrange(4)):
            if broken:
                broken[draw.randrange(len(broken))] = draw.randrange(256)
        try:
            fields = reader.read(bytes(broken))
        except MalformedMessageError:
            continue
        assert len(fields.name) <= len(broken)
    huge = data[:12] + struct.pack("<I", 1) + b"\0\0\0\0" + struct.pack("<I", 2**32 - 1)
    with pytest.raises(MalformedMessageError):
        reader.read(huge)
