"""A section of a parameter file that was meant for a node and is not applied is refused."""

from pathlib import Path

import pytest

from pam_ros.errors import ParameterError
from pam_ros.parameter_files import refuse_doubled_keys, refuse_lost_sections, sections_of

NODE = "/left/pam_controller"
BODY = "\n  ros__parameters:\n    law: torque\n"


def written(tmp_path: Path, *names: str) -> list[Path]:
    file = tmp_path / "my.yaml"
    file.write_text("# mine\n" + "".join(f"{name}:{BODY}" for name in names))
    return [file]


@pytest.mark.parametrize("node", ["/pam_controller", NODE, "/a/b/pam_controller"])
@pytest.mark.parametrize("name", ["/**/pam_controller", "/**"])
def test_the_form_that_fits_everywhere_is_taken(tmp_path: Path, node: str, name: str) -> None:
    assert refuse_lost_sections(node, "pam_controller", written(tmp_path, name)) == []


@pytest.mark.parametrize(
    "name", ["pam_controller", "/pam_controller", "pam_controler", "/**/pam_contoller",
             "/lefft/pam_controller", "left/pam_controler", "PAM_Controller", "/*/pam_control",
             "pam-controller"]
)  # fmt: skip
def test_a_section_that_ros_would_drop_is_refused_with_the_line_to_write(
    tmp_path: Path, name: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        refuse_lost_sections(NODE, "pam_controller", written(tmp_path, "/**", name))
    told = str(caught.value)
    assert "my.yaml, line 5" in told
    assert "/**/pam_controller:" in told
    assert NODE in told


def test_a_renamed_node_is_told_its_present_name(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"Write /\*\*/left_hand: in its place"):
        refuse_lost_sections(
            "/left_hand",
            "pam_controller",
            written(tmp_path, "/**/pam_controller", "pam_controller"),
        )


@pytest.mark.parametrize(
    "names",
    [("arm_controller",), ("controller_manager",), ("pam_driver",), ("pam_controller2",),
     ("pam_controller_left",), ("/right/**",),
     ("pam_controller", "/left/pam_controller"), ("pam_controler", "/**/pam_controller")],
)  # fmt: skip
def test_sections_of_other_nodes_and_files_for_several_robots_are_none_of_its_business(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    assert refuse_lost_sections(NODE, "pam_controller", written(tmp_path, *names)) == []


def test_a_section_for_another_namespace_is_a_warning(tmp_path: Path) -> None:
    told = refuse_lost_sections(NODE, "pam_controller", written(tmp_path, "/right/pam_controller"))
    assert len(told) == 1
    assert "is not applied, because this node is /left/pam_controller" in told[0]


def test_nested_namespaces_and_files_that_are_none(tmp_path: Path) -> None:
    file = tmp_path / "nested.yaml"
    file.write_text("left:\n  pam_controller:\n    ros__parameters:\n      law: torque\n")
    assert [(each.name, each.line) for each in sections_of(file)] == [("left/pam_controller", 2)]
    assert refuse_lost_sections(NODE, "pam_controller", [file]) == []
    for content in ("[" * 5000, "a: [", "\x00", "3", ""):
        file.write_text(content)
        assert sections_of(file) == []
    assert sections_of(tmp_path) == []


@pytest.mark.parametrize(
    ("body", "line", "key"),
    [
        ("    law: torque\n    law: impedance\n", 4, "law"),
        ("    elbow:\n      inertia: 0.05\n      inertia: 0.5\n", 5, "elbow.inertia"),
        ("    elbow: {a: 1}\n    b: 2\n    elbow: {c: 1}\n", 5, "elbow"),
    ],
)
def test_a_parameter_that_a_file_states_twice_is_refused(
    tmp_path: Path, body: str, line: int, key: str
) -> None:
    """Tools refuse such a rig file, and a node ran with the last of both numbers."""
    file = tmp_path / "my.yaml"
    file.write_text(f"/**/pam_controller:\n  ros__parameters:\n{body}")
    with pytest.raises(ParameterError, match=rf"my.yaml, line {line}: '{key}' appears twice"):
        refuse_doubled_keys(NODE, [file])
    refuse_doubled_keys("/left/pam_driver", [file])


def test_what_stands_in_several_sections_is_stated_once_in_each(tmp_path: Path) -> None:
    files = written(tmp_path, "/**", "/**/pam_controller")
    refuse_doubled_keys(NODE, files)
