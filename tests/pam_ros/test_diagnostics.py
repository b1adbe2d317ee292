"""Health as REP-107 messages."""

import math

import pytest

pytest.importorskip("diagnostic_msgs.msg")

from builtin_interfaces.msg import Time

from pam_ros.diagnostics import OK, WARN, diagnostic_array, diagnostic_status, loop_values
from pam_ros.periodic import LoopStatistics


def test_status_shows_values_as_text() -> None:
    values = {"age [s]": 0.123456789, "missing": math.nan, "cycles": 7}
    status = diagnostic_status("pam_model: estimates", WARN, "one is old", values, "board 0")
    assert (status.name, status.level, status.message) == (
        "pam_model: estimates",
        WARN,
        "one is old",
    )
    assert status.hardware_id == "board 0"
    assert [(pair.key, pair.value) for pair in status.values] == [
        ("age [s]", "0.123457"),
        ("missing", "nan"),
        ("cycles", "7"),
    ]


def test_array_carries_stamp_and_parts() -> None:
    parts = [diagnostic_status(name, OK, "fine", {}) for name in ("a", "b")]
    array = diagnostic_array(Time(sec=3, nanosec=5), *parts)
    assert (array.header.stamp.sec, array.header.stamp.nanosec) == (3, 5)
    assert [status.name for status in array.status] == ["a", "b"]


def test_loop_statistics_name_their_unit() -> None:
    values = loop_values(LoopStatistics(cycles=10, late=2, skipped=1, worst_lateness=0.004))
    assert values["worst lateness [ms]"] == pytest.approx(4.0)
    assert values["late cycles"] == 2
