"""Makes REP-107 messages about the health of a node; no ROS node is needed to make them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from pam_ros.periodic import LoopStatistics

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE


def _text(value: object) -> str:
    if isinstance(value, float):
        return "nan" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def diagnostic_status(
    name: str, level: bytes, message: str, values: Mapping[str, object], hardware_id: str = ""
) -> Any:
    """The health of one part of a node.

    Parameters
    ----------
    name : str
        "node: part".
    level : bytes
        OK, WARN, ERROR or STALE of this module.
    message : str
        One line for the user.
    values : mapping
        Shown as text; the key names the unit.
    hardware_id : str, optional
        The device that the status describes.

    Returns
    -------
    diagnostic_msgs.msg.DiagnosticStatus
    """
    pairs = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    return DiagnosticStatus(
        name=name, level=level, message=message, hardware_id=hardware_id, values=pairs
    )


def loop_values(statistics: LoopStatistics) -> dict[str, object]:
    """The timing of a periodic loop, as values of a status."""
    return {
        "cycles": statistics.cycles,
        "late cycles": statistics.late,
        "skipped cycles": statistics.skipped,
        "worst lateness [ms]": 1e3 * statistics.worst_lateness,
        "real-time priority": statistics.priority or "none",
    }


def diagnostic_array(stamp: Any, *statuses: Any, namespace: str = "/") -> Any:
    """The message for /diagnostics, a topic that all robots share.

    Parameters
    ----------
    stamp : builtin_interfaces.msg.Time
        When the statuses were determined.
    statuses : diagnostic_msgs.msg.DiagnosticStatus
        The health of the parts.
    namespace : str, optional
        Namespace of the node. If there is one, names and hardware identifiers begin with it, for
        example "robot1/pam_driver: safety", so that the statuses of two robots differ.
    """
    robot = namespace.strip("/")
    if robot:
        for status in statuses:
            status.name = f"{robot}/{status.name}"
            if status.hardware_id:
                status.hardware_id = f"{robot}/{status.hardware_id}"
    array = DiagnosticArray(status=list(statuses))
    array.header.stamp = stamp
    return array
