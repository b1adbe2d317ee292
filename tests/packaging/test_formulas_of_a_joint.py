"""Formulas of a joint or muscle stand in pam_model; everybody else asks its views.

The numbers of a formula are read from a robot, a rig or a model: as attributes, by their names in
the plant's parameters, or from rows of constants. A file outside pam_model that reads one of them
has a formula of its own.
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
NUMBERS = frozenset(
    {
        "gravity_torque",
        "gravity_angle",
        "inertia",
        "viscous_friction",
        "pulley_radius",
        "neutral_length",
        "dead_volume",
    }
)
OF_ROWS = frozenset(
    {
        "C_GRAVITY",
        "C_GRAVITY_ANGLE",
        "C_INERTIA",
        "C_PER_INERTIA",
        "C_RADIUS",
        "C_VISCOUS",
        "M_DEAD",
        "M_NEUTRAL",
    }
)
"""The same numbers, where they stand in a row for compiled functions."""
INDEPENDENT = ("pam_check/blind/", "pam_check/calibration/", "pam_check/control/")
"""Plants and rigs of the checks, which are the independent truth and share no law on purpose."""


def formulas(source: str) -> list[str]:
    """The numbers of a joint or muscle that a module reads."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and node.attr in NUMBERS:
            found.append(node.attr)
        if isinstance(node, ast.Name) and node.id in OF_ROWS:
            found.append(node.id)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
            name = str(node.slice.value).rpartition(".")
            if name[0] and name[2] in NUMBERS:
                found.append(name[2])
    return found


def modules() -> dict[str, list[str]]:
    """What every module outside pam_model reads, by its path in src/ or proof/."""
    found = {}
    names = {
        path.relative_to(ROOT / "src").as_posix(): path
        for path in sorted((ROOT / "src").glob("pam_*/**/*.py"))
    }
    names |= {
        path.relative_to(ROOT / "proof").as_posix(): path
        for path in sorted((ROOT / "proof").glob("pam_*/**/*.py"))
    }
    for name, path in names.items():
        if not name.startswith(("pam_model/", *INDEPENDENT)):
            found[name] = formulas(path.read_text())
    return found


def test_no_file_has_formulas_of_a_joint() -> None:
    further = {name: sorted(set(read)) for name, read in modules().items() if read}
    assert not further, f"ask pam_model.views instead: {further}"


def test_the_rule_sees_attributes_and_names_of_parameters() -> None:
    assert formulas("rate = joint.inertia * a") == ["inertia"]
    assert formulas("base['joint.pulley_radius']") == ["pulley_radius"]
    assert formulas("torque = c[C_GRAVITY] * math.sin(q)") == ["C_GRAVITY"]
    assert formulas("numbers['inertia']; joint.name; x['joint.lower_limit']") == []
