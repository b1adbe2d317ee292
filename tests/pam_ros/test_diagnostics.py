"""Health as REP-107 messages."""

import ast
import math

import pytest

pytest.importorskip("diagnostic_msgs.msg")

from builtin_interfaces.msg import Time

from pam_ros.diagnostics import OK, WARN, diagnostic_array, diagnostic_status, loop_values
from pam_ros.periodic import LoopStatistics
from support.source_tree import modules


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


def test_two_robots_are_told_apart_by_their_namespaces() -> None:
    def names(namespace: str) -> list[tuple[str, str]]:
        board = diagnostic_status("pam_driver: board 0", OK, "fine", {}, "board 0")
        safety = diagnostic_status("pam_driver: safety", OK, "fine", {})
        array = diagnostic_array(Time(), board, safety, namespace=namespace)
        return [(status.name, status.hardware_id) for status in array.status]

    plain = [("pam_driver: board 0", "board 0"), ("pam_driver: safety", "")]
    assert names("/") == names("") == plain
    assert names("/lab/robot1") == [
        ("lab/robot1/pam_driver: board 0", "lab/robot1/board 0"),
        ("lab/robot1/pam_driver: safety", ""),
    ]


def test_every_node_tells_its_namespace_with_its_health() -> None:
    told = {}
    for path in (path for path in modules().values() if path.name.endswith("_node.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("diagnostic_array"):
                given = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}
                told[path.name] = given.get("namespace")
    assert len(told) >= 5
    assert set(told.values()) == {"self.get_namespace()"}, told
