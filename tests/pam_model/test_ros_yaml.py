"""What a node's YAML reader refuses, `load_rig` refuses first; the reader of ROS itself judges."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context

from pam_model.errors import RigError
from pam_model.rig import load_rig
from support.rigs import CONFIG

ONE_LINK = CONFIG / "elbow.yaml"
SCALARS = (
    "-1", "+2", "010", "0x1F", "99999999999999999999",
    "1.0", ".5", "1e-5", "1.0e+400", "1e-320", "-.inf", ".nan",
    "true", "on", "Y", "text", "'1'", "2001-01-01", "~", '""',
)  # fmt: skip
RIGS = sorted(CONFIG.glob("elbow*.yaml")) + sorted(CONFIG.glob("two_*.yaml"))
VALUES = (
    *(f"[{a}, {b}]" for a, b in product(SCALARS, SCALARS) if a != b),
    "[]", "[[1.0]]", "[{a: 1}]", "", "{}", *SCALARS,
)  # fmt: skip


def node_reads(path: Path) -> bool:
    """Whether the parameter file can be given to a node."""
    context = Context()
    try:
        rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
    except RuntimeError:
        return False
    rclpy.shutdown(context=context)
    return True


def test_a_list_that_a_node_refuses_is_refused_with_its_line_and_what_to_write(
    tmp_path: Path,
) -> None:
    path = tmp_path / "rig.yaml"
    text = ONE_LINK.read_text()
    line = next(n for n, row in enumerate(text.splitlines(), 1) if "position_limits:" in row)
    path.write_text(text.replace("position_limits: [-1.0, 1.0]", "position_limits: [-1, 1.0]"))
    assert not node_reads(path)
    with pytest.raises(RigError, match=f"rig.yaml: line {line}: .* write -1.0 for -1"):
        load_rig(path)


def test_the_tools_refuse_every_value_that_a_node_refuses(tmp_path: Path) -> None:
    """Every list of two scalars, and every other value."""
    path = tmp_path / "rig.yaml"
    accepted = 0
    for value in VALUES:
        path.write_text(f"/**:\n  other: 1\n  key: {value}\n")  # no rig, which is told last
        with pytest.raises(RigError) as caught:
            load_rig(path)
        if "not a rig file" in str(caught.value):
            path.write_text(f"/**:\n  ros__parameters:\n    key: {value}\n    other: 1\n")
            assert node_reads(path), value
            accepted += 1
        else:
            assert "line 3" in str(caught.value), (value, caught.value)
    assert accepted > 60


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_every_file_of_the_project_can_be_given_to_a_node(path: Path) -> None:
    assert node_reads(path)
    load_rig(path)
