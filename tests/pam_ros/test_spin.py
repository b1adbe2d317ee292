"""Starting a node from the command line: what is a mistake of the user, and what is a fault."""

import pytest

pytest.importorskip("rclpy")

from pam_ros.errors import ParameterError
from pam_ros.spin import spin_node


class MisreadDrawingError(Exception):
    """What a node of another project may raise for its user."""


@pytest.mark.parametrize("kind", [ParameterError, MisreadDrawingError])
def test_a_users_mistake_is_one_line_and_exit_code_2(
    kind: type[Exception], capsys: pytest.CaptureFixture[str]
) -> None:
    def make_node() -> None:
        raise kind("length = 3 mm: must be from 5 to 9 mm")

    assert spin_node(make_node, [], mistake=MisreadDrawingError) == 2
    assert capsys.readouterr().err == "length = 3 mm: must be from 5 to 9 mm\n"


def test_a_fault_of_the_program_is_not_taken_for_a_users_mistake() -> None:
    def make_node() -> None:
        raise LookupError("a bug")

    with pytest.raises(LookupError, match="a bug"):
        spin_node(make_node, [], mistake=MisreadDrawingError)
