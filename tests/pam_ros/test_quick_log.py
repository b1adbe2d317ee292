"""A line of the log names its place, and no source code is read for it."""

from __future__ import annotations

import inspect

import pytest

pytest.importorskip("rclpy")

from rclpy.impl.rcutils_logger import CallerId, RcutilsLogger

from pam_ros.quick_log import leave_source_code_alone


def test_a_caller_is_found_without_its_source(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_source_code_alone()
    monkeypatch.setattr(inspect, "findsource", pytest.fail)
    caller = CallerId()
    assert caller.function_name == "test_a_caller_is_found_without_its_source"
    assert caller.file_path == __file__
    assert RcutilsLogger("of_a_test").info("written")
