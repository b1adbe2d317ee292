"""Finds the class of a message by the name that a topic, a recording or a field gives its type."""

from __future__ import annotations

import importlib
from typing import Any


def message_type(name: str) -> Any:
    """The class of a type of message.

    Parameters
    ----------
    name : str
        For example "sensor_msgs/msg/JointState".

    Raises
    ------
    LookupError
        If no such type is installed.
    """
    package, _, kind = name.rpartition("/")
    try:
        return getattr(importlib.import_module(package.replace("/", ".")), kind)
    except (ImportError, AttributeError, ValueError):
        raise LookupError("no such type of message is installed") from None
