"""Health as REP-107 messages; no ROS node is needed to make them."""

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
    """One part's health.

    Parameters
    ----------
    name : str
        "node: part".
    level : bytes
        OK, WARN, ERROR or STALE of this module.
    message : str
        One line for a person.
    values : mapping
        Shown as text; the key names the unit.
    hardware_id : str, optional
        Which device.

    Returns
    -------
    diagnostic_msgs.msg.DiagnosticStatus
    """
    pairs = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    return DiagnosticStatus(
        name=name, level=level, message=message, hardware_id=hardware_id, values=pairs
    )


def loop_values(statistics: LoopStatistics) -> dict[str, object]:
    """How well a periodic loop keeps time, as values of a status."""
    return {
        "cycles": statistics.cycles,
        "late cycles": statistics.late,
        "skipped cycles": statistics.skipped,
        "worst lateness [ms]": 1e3 * statistics.worst_lateness,
        "real-time priority": statistics.priority or "none",
    }


def diagnostic_array(stamp: Any, *statuses: Any, namespace: str = "/") -> Any:
    """The message for /diagnostics, which all robots share.

    Parameters
    ----------
    stamp : builtin_interfaces.msg.Time
        When the parts were looked at.
    statuses : diagnostic_msgs.msg.DiagnosticStatus
        The parts' health.
    namespace : str, optional
        Of the node; where it has one, names and hardware identifiers begin with it, as
        "robot1/pam_driver: safety", so that two robots are told apart.
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
