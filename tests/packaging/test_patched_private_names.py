"""Tests change what the code offers for it, such as an argument, and no private name elsewhere.

Whoever renames a private name reads its module alone. A test that changes it breaks then, and where
only `make test-all` runs the test, nobody notices for a while. The list holds the names that are
left. It only shrinks, and each of them must still be in use.
"""

from __future__ import annotations

import ast
import re

import pytest

from support.source_tree import ROOT

LEFT = {
    "helpers/support/broken_boards.py": {"_armed"},
    "pam_bringup/test_viewer.py": {"_stream"},
    "pam_check/test_faults.py": {"_watchdog"},
    "pam_check/test_fuzz.py": {"_activation_problem"},
    "pam_check/test_fuzz_every_node.py": {"_TEXTS", "_reason_against_references"},
    "pam_check/test_kinds_without_their_guard.py": {
        "_RESTARTS",
        "_command_time",
        "_reason_against",
    },
    "pam_check/test_soak.py": {"_bus"},
    "pam_control/test_kept_designs.py": {"_design"},
    "pam_control/test_stop_never_waits.py": {"_designed_and_checked", "_limits"},
    "pam_demo/test_commission.py": {"_allowed"},
    "pam_demo/test_demo_start.py": {
        "_call",
        "_fault",
        "_intake",
        "_name",
        "_play",
        "_refusals",
        "_refused",
        "_send_stiffness",
        "_send_trajectory",
    },
    "pam_demo/test_loop_rate.py": {"_counts"},
    "pam_driver/test_bus.py": {"_extended"},
    "pam_driver/test_driver_faults.py": {"_controller"},
    "pam_driver/test_driver_node_inside.py": {"_ready_since"},
    "pam_driver/test_driver_node_state.py": {"_lamps", "_states"},
    "pam_model/test_compile_beside.py": {"_CACHE"},
    "pam_model/test_kernel_cache.py": {"_CACHE", "_HERE"},
    "pam_robot/test_robot_nodes.py": {"_work"},
    "pam_ros/test_phase_follower.py": {"_shift"},
    "system/test_unforeseen_exceptions.py": {"_error", "_thread"},
}
"""Names that tests of a file still change."""
LIKELY = re.compile(r"attr\(.*_|attr\(\n|\._[A-Za-z]\w*.*=")
"""Of files that are worth parsing."""


def changed(tree: ast.Module) -> set[str]:
    """Private names that a test sets on something else than itself."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr in ("setattr", "delattr"):
                names = [each.value for each in node.args[:2] if isinstance(each, ast.Constant)]
                found |= {str(name).rpartition(".")[2] for name in names[:1]}
        elif isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            flat = [one for each in targets for one in getattr(each, "elts", [each])]
            found |= {
                each.attr
                for each in flat
                if isinstance(each, ast.Attribute)
                and not (isinstance(each.value, ast.Name) and each.value.id in ("self", "cls"))
            }
    return {name for name in found if name[:1] == "_" and name[:2] != "__"}


def test_no_test_changes_a_private_name_that_is_not_in_the_list() -> None:
    found = {
        path.relative_to(ROOT / "tests").as_posix(): names
        for path in sorted((ROOT / "tests").rglob("*.py"))
        if LIKELY.search(text := path.read_text(encoding="utf-8"))
        and (names := changed(ast.parse(text)))
    }
    new = {file: names - LEFT.get(file, set()) for file, names in found.items()}
    assert not any(new.values()), f"give the code an argument, or make the name public: {new}"
    gone = {file: names - found.get(file, set()) for file, names in LEFT.items()}
    assert not any(gone.values()), f"strike these from the list: {gone}"


def test_the_names_that_are_left_are_still_in_use() -> None:
    text = "\n".join(
        path.read_text(encoding="utf-8")
        for root in ("src", "proof", "tests/helpers")
        for path in (ROOT / root).rglob("*.py")
    )
    used = set(re.findall(r"\b_[A-Za-z]\w*", text))
    missing = {name for names in LEFT.values() for name in names} - used
    assert not missing, f"no module has {missing} any more"


@pytest.mark.parametrize(
    "line",
    [
        "patch.setattr(module, '_clock', lambda: 0.0)",
        "monkeypatch.setattr('pam_x.part._clock', lambda: 0.0)",
        "loop._clock = now",
        "loop._a, loop._clock = 0, now",
        "loop._clock += 1",
    ],
)
def test_the_rule_sees_each_way_to_change_a_name(line: str) -> None:
    assert "_clock" in changed(ast.parse(line))
    assert not changed(ast.parse(line.replace("_clock", "clock").replace("_a", "a")))
    assert not changed(ast.parse("self._clock = now"))
