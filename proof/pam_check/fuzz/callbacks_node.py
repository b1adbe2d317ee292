"""Calls the callbacks of the nodes with random and mutated messages.

`pam check fuzz-callbacks --count 1000000` creates the nodes in this process, calls the
callback of each subscription with that many messages, and calls the timers in between. No exception
may escape, and a driver that was not activated must not allow air flow. One half are messages of
the topic's type with random names, sizes, numbers and stamps; the other half are their bytes,
spoilt (`pam_check.fuzz.message_bytes`). The subscriptions are those that the nodes have.
"""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import rclpy
from rclpy.logging import LoggingSeverity

from pam_check.fuzz.fuzz_run import BLOCK
from pam_check.fuzz.messages import Messages
from pam_check.fuzz.random_targets import ViolationError
from pam_demo.chain import private_domain, set_environment
from pam_driver.boards.pam_board.codec import BoardCodec, FrameError, ValveCommand
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig
from pam_ros.node_end import end_node
from pam_ros.start import start_ros
from pam_ros.subscriptions import GuardedTopic

CHANNEL: Final = "fuzz"


@contextmanager
def made_nodes(
    rig: Path, kinds: Sequence[Callable[[], Any]], parameters: Sequence[str] = ()
) -> Iterator[list[Any]]:
    """One node of each kind for a rig file, with a configured driver; they end with the context.

    Parameters
    ----------
    rig : Path
        Rig file of the nodes.
    kinds : sequence of callable
        The nodes' classes, the driver's first.
    parameters : sequence of str, optional
        Further parameters, as after -p.

    Raises
    ------
    PamError
        If the driver does not configure.
    """
    arguments = ["--ros-args", "--params-file", str(rig)]
    for name in ("pam_driver", "pam_rig"):
        # two buses, so that no board answers to the random commands
        for key, value in (("interface", "virtual"), ("channel", f"{CHANNEL}_{name}")):
            arguments += ["-p", f"{name}:bus.{key}:={value}"]
    with set_environment(private_domain()):
        for parameter in ("pam_driver:autostart:=false", *parameters):
            arguments += ["-p", parameter]
        start_ros(arguments)
    nodes: list[Any] = []
    try:
        for kind in kinds:
            node = kind()
            node.get_logger().set_level(LoggingSeverity.FATAL)  # hides warnings
            nodes.append(node)
        nodes[0].trigger_configure()
        yield nodes
    finally:
        for node in nodes:
            if hasattr(node, "close"):
                node.close()
            node.get_logger().set_level(LoggingSeverity.UNSET)  # levels outlive the node
            end_node(node)
        rclpy.try_shutdown()


def callbacks(node: Any) -> list[tuple[str, type, GuardedTopic]]:
    """Topic, type and callback of every subscription, including those that a loop polls.

    Raises
    ------
    ViolationError
        For a subscription without the guarded decoder.
    """
    polled = [one.subscription for one in getattr(node, "polled_topics", ())]
    found = []
    for one in (*node.subscriptions, *polled):
        if not isinstance(one.callback, GuardedTopic) or not one.raw:
            raise ViolationError(f"{one.topic_name}: does not pass the guarded decoder")
        found.append((one.topic_name, one.msg_type, one.callback))
    return found


def no_air(port: CanPort, codec: BoardCodec, now: float) -> None:
    """Raise an error if any queued frame allows air flow."""
    frames = port.receive_all(now)
    while frames:
        for frame in frames:
            try:
                _, message = codec.decode(frame.frame_id, frame.data)
            except FrameError:
                continue
            if isinstance(message, ValveCommand) and any(message.enable):
                raise ViolationError("a driver that is not active allows air flow")
        frames = port.receive_all(now)


def fuzz_callbacks(
    rig: Path,
    count: int,
    seed: int,
    kinds: Sequence[Callable[[], Any]],
    parameters: Sequence[str] = (),
) -> dict[str, list[str]]:
    """Send messages through every callback; return the escaped exceptions by node and topic.

    Parameters
    ----------
    rig : Path
        Rig file of the nodes.
    count : int
        Number of messages for each callback, in blocks of BLOCK.
    seed : int
        Seed of the first block.
    kinds : sequence of callable
        The nodes' classes, the driver's first.
    parameters : sequence of str, optional
        Further parameters of the nodes, as after -p.

    Raises
    ------
    PamError
        If a node cannot be created.
    ViolationError
        For a subscription without the guarded decoder.
    """
    failed: dict[str, list[str]] = {}
    codec = BoardCodec.from_dbc()
    given = load_rig(rig)
    port = open_bus("virtual", f"{CHANNEL}_pam_driver")
    try:
        with made_nodes(rig, kinds, parameters) as nodes:
            for node in nodes:
                for topic, message_type, callback in callbacks(node):
                    escaped = failed.setdefault(f"{node.get_name()} {topic}", [])
                    for block in range(seed, seed + max(1, count // BLOCK)):
                        messages = Messages(given, random.Random(block))
                        try:
                            for _ in range(BLOCK):
                                callback(messages.data(message_type))
                            for timer in node.timers:
                                timer.callback()
                            no_air(port, codec, time.monotonic())
                        except Exception as error:  # every exception that escapes is a finding
                            escaped.append(f"seed {block}: {type(error).__name__}: {error}")
                if hasattr(node, "check"):
                    node.check()
    finally:
        port.close()
    return failed


def run(given: Arguments, kinds: Sequence[Callable[[], Any]]) -> Outcome:
    """Fuzz and print the result; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig that cannot be used, or a node that cannot be created.
    """
    failed = fuzz_callbacks(chosen_rig(given), given.count, given.seed, kinds)
    for name, escaped in failed.items():
        print(f"{name}: {given.count} messages, {len(escaped)} blocks failed")
        for text in escaped[:3]:
            print(f"  {text[:300]}", file=sys.stderr)
    return Outcome(
        {"messages": given.count, "failed": failed},
        [f"{name}: {len(escaped)} blocks failed" for name, escaped in failed.items() if escaped],
    )
