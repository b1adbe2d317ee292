"""Hands the messages of a bag, or what is intact of it, to a view, without a ROS installation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from pam_bringup.viewer.robot_view import TOPICS, RobotView
from pam_gap.recordings.broken_bag import bag_reader, read_bag
from pam_model.errors import PamError


def show_bag(path: Path, namespace: str, view: RobotView) -> int:
    """Show every message of a recording; returns their number.

    Parameters
    ----------
    path : Path
        Folder or file of the rosbag2.
    namespace : str
        Namespace of the robot in the recording; may be empty.
    view : RobotView
        Takes the messages.

    Raises
    ------
    PamError
        If the recording cannot be read, or has none of the topics.
    """
    prefix = "/" + namespace.strip("/") if namespace.strip("/") else ""
    wanted = {name if name[0] == "/" else f"{prefix}/{name}": name for name in TOPICS}

    def show(files: list[Path]) -> int:
        count = 0
        with bag_reader(files) as reader:
            connections = [entry for entry in reader.connections if entry.topic in wanted]
            for connection, received, data in reader.messages(connections=connections):
                message: Any = reader.deserialize(data, connection.msgtype)
                view.take(wanted[connection.topic], 1e-9 * received, message)
                count += 1
        return count

    count, damage = read_bag(path, show)
    for text in damage:
        print(f"warning: {text}", file=sys.stderr)
    if not count:
        raise PamError(f"{path}: none of the topics {', '.join(wanted)} is in it")
    return count
