"""The end of a node: the threads of its middleware end with it, and not with the process.

What is still alive of a node when the process ends is freed while Fast DDS takes its own static
objects away. The order of the two is not fixed, and such a process ends with a segmentation fault
now and then (ros2/rmw_fastrtps, pull request 770, which is not in Jazzy).
"""

from __future__ import annotations

import gc
from typing import Any


def end_node(node: Any, executor: Any = None) -> None:
    """End an executor and its node, and all that rclpy's `destroy_node` leaves alive.

    Parameters
    ----------
    node : rclpy.node.Node or None
        The node. Its `polled_topics`, if it has any, end too. None: it could not be made.
    executor : rclpy.executors.Executor or None, optional
        The executor that the node was added to.
    """
    if executor is not None:  # before the node: its threads may call what is gone
        executor.shutdown()
    if node is None:
        gc.collect()  # what was made of a node before a mistake was found
        return
    node.destroy_node()
    for topic in getattr(node, "polled_topics", ()):  # after the loop that polls them
        topic.destroy()
    machine = getattr(node, "_state_machine", None)  # of a lifecycle node
    if machine is not None:
        machine.destroy_when_not_in_use()
