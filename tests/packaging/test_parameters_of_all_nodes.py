"""Every parameter of every node has a text, and a range or a list of values where it is a number.

The nodes are found in the source: a new one is included by itself.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.context import Context  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter as RosParameter  # noqa: E402

from pam_control.controller_parameters import parameter_table  # noqa: E402
from pam_model.rig import described_key, load_rig, rig_of_node  # noqa: E402
from pam_model.rig.types import NUMBERS  # noqa: E402
from pam_ros.parameters import NodeParameters  # noqa: E402
from support.source_tree import ROOT, SOURCE, modules  # noqa: E402

ELBOW = ROOT / "config" / "elbow.yaml"
FILES = sorted(
    path
    for path in SOURCE.rglob("*_node.py")
    if "automatically_declare_parameters_from_overrides" in path.read_text(encoding="utf-8")
)
NUMERIC = (RosParameter.Type.DOUBLE, RosParameter.Type.INTEGER)


def module_of(path: Path) -> Any:
    parts = path.relative_to(SOURCE).with_suffix("").parts[1:]
    return importlib.import_module(".".join(parts))


def flat(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = list(value) if isinstance(value, tuple) else value
    return found


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    made = Context()
    rclpy.init(context=made)
    yield made
    made.try_shutdown()


CASES = [(path, "elbow.yaml") for path in FILES]
CASES += [(FILES[0], "elbow_vendor_dbc.yaml"), (FILES[0], "elbow_canopen.yaml")]


@pytest.mark.parametrize(("path", "rig_file"), CASES, ids=lambda each: Path(each).stem)
def test_every_parameter_is_described(context: Context, path: Path, rig_file: str) -> None:
    module = module_of(path)
    rig = load_rig(ROOT / "config" / rig_file)
    # the help of the controller leaves its many parameters to `pam control parameters`
    table = module.HELP.parameters or parameter_table(rig.joint_names)
    given = flat(rig.to_parameters())
    node = Node(
        module.NAME,
        context=context,
        automatically_declare_parameters_from_overrides=True,
        parameter_overrides=[RosParameter(name, value=value) for name, value in given.items()],
        start_parameter_services=False,
    )
    try:
        NodeParameters(node, table, rig_of_node, describe=described_key, usual_name=module.NAME)
        changeable = {p.name for p in table if p.changeable}
        for name, parameter in node.get_parameters_by_prefix("").items():
            if name in ("use_sim_time", "start_type_description_service"):
                continue
            told = node.describe_parameter(name)
            assert re.fullmatch(r".{5,} \[.+\]", told.description), (name, told.description)
            assert told.read_only == (name not in changeable), name
            if parameter.type_ in NUMERIC and _is_number(name):
                assert told.floating_point_range or told.integer_range, name
    finally:
        node.destroy_node()


def _is_number(name: str) -> bool:
    """Whether a key is a number, and not the place of a board or the choice of a maker."""
    return not name.startswith("boards.") and name.rsplit(".", maxsplit=1)[-1] not in (
        "board",
        "channel",
    )


def test_a_node_declares_its_parameters_in_one_way() -> None:
    """Only NodeParameters declares: whatever a file adds is described there, or refused."""
    for path in modules().values():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if path.name == "parameters.py" and path.parent.name == "pam_ros":
            continue
        called = {n.func.attr for n in ast.walk(tree)
                  if isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute)}  # fmt: skip
        assert not called & {"declare_parameter", "declare_parameters"}, path


def test_the_page_of_the_rig_file_says_what_a_parameter_says() -> None:
    page = (ROOT / "docs" / "rig_file.md").read_text(encoding="utf-8")
    page = (
        re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", page).replace("`", "").replace(" (safety.md)", "")
    )
    texts = [key.text for section in NUMBERS.values() for key in section.values()]
    assert all(texts)
    assert [text for text in texts if text not in page] == []
