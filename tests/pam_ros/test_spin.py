"""Starting a node from the command line: what is a mistake of the user, and what is a fault."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.node import Node

from pam_ros import end_signals
from pam_ros.end_signals import EndSignals
from pam_ros.errors import ParameterError
from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter
from pam_ros.spin import spin_node
from pam_ros.unforeseen import BROKEN

pytestmark = pytest.mark.system

HELP = NodeHelp(
    program="ros2 run drawing reader",
    purpose="Reads drawings.",
    parameters=[
        Parameter("length", 6.0, "mm", 5.0, 9.0, "of the part", changeable=True),
        Parameter("sheets", 100_000, "-", 1, 1_000_000, "how many are read"),
        Parameter("loud", False, "-", 0, 0, "says what it reads"),
        Parameter("author", "", "-", 0, 0, "whose drawings"),
    ],
    other_keys="the keys of the drawing",
    example="--ros-args --params-file drawing.yaml",
    publishes=[Endpoint("~/parts", "std_msgs/String", "what was read")],
)


@pytest.fixture(autouse=True)
def _handlers() -> Iterator[None]:
    """Whoever has ended by a signal keeps noting signals, for its process ends."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def never() -> None:
    raise AssertionError("the node must not be made")


class MisreadDrawingError(Exception):
    """What a node of another project may raise for its user."""


@pytest.mark.parametrize("kind", [ParameterError, MisreadDrawingError])
def test_a_users_mistake_is_one_line_and_exit_code_2(
    kind: type[Exception], capsys: pytest.CaptureFixture[str]
) -> None:
    def make_node() -> None:
        raise kind("length = 3 mm: must be from 5 to 9 mm")

    assert spin_node(make_node, HELP, [], mistake=MisreadDrawingError) == 2
    assert capsys.readouterr().err == "error: length = 3 mm: must be from 5 to 9 mm\n"


def test_a_fault_of_the_program_is_not_taken_for_a_users_mistake() -> None:
    def make_node() -> None:
        raise LookupError("a bug")

    with pytest.raises(LookupError, match="a bug"):
        spin_node(make_node, HELP, [], mistake=MisreadDrawingError)


def test_what_a_running_node_raises_in_a_cycle_is_no_mistake_of_the_user() -> None:
    def check(node: Node) -> None:
        raise MisreadDrawingError("length = 3 mm: must be from 5 to 9 mm")

    ways = {"mistake": MisreadDrawingError, "only_at_start": True}
    assert spin_node(lambda: Node("reader"), HELP, [], check, **ways) == BROKEN


@pytest.mark.parametrize("word", ["--help", "-h"])
def test_help_names_parameters_with_units_and_ranges_topics_and_an_example(
    word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert spin_node(never, HELP, [word], mistake=MisreadDrawingError) == 0
    told = capsys.readouterr()
    assert told.err == ""
    for text in (
        "Reads drawings.",
        "length  = 6 mm, from 5 to 9 mm",
        "of the part. May change while the node runs.",
        "sheets  = 100000, from 1 to 1000000\n",
        "loud  = false",
        'author  = ""',
        "the keys of the drawing",
        "~/parts  (std_msgs/String)",
        "ros2 run drawing reader --ros-args --params-file drawing.yaml",
    ):
        assert text in told.out


@pytest.mark.sampled("two of the wrong command lines", cases=2)
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--lenght", "6"], "--lenght 6"),
        (["--ros-args", "--lenght"], "--lenght"),
        (["--ros-args", "--params-file", "/no/such.yaml"], "/no/such.yaml: no such file"),
        (["--ros-args", "--params-file", "/tmp"], "/tmp: is a folder"),
        (["--ros-args", "-p"], "-p"),
        (["--ros-args", "-p", "length"], "-p length"),
    ],
)
def test_a_wrong_command_line_of_a_node_is_one_line(
    words: list[str], told: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert spin_node(never, HELP, words, mistake=MisreadDrawingError) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert told in line


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_node_is_made_ends_it_after_it_is_made(number: int) -> None:
    """A context that a signal closes in the middle of making a node may abort the process."""
    ends: list[str] = []

    class Drawer(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            os.kill(os.getpid(), number)
            time.sleep(0.2)  # the handlers of rclpy close the context from a thread of their own
            super().__init__("drawer")
            self.create_timer(0.01, lambda: ends.append("turned"))
            ends.append(f"made, context open: {rclpy.ok()}")

        def destroy_node(self) -> None:
            ends.append(f"destroyed, context open: {rclpy.ok()}")
            super().destroy_node()

    assert spin_node(Drawer, HELP, [], mistake=MisreadDrawingError) == 0
    assert ends == ["made, context open: True", "destroyed, context open: True"]
    assert not rclpy.ok()
    os.kill(os.getpid(), number)  # the same request, handed on by launch: the process is ending


SIGNALLED_IN_A_CALLBACK = """
import os, signal, sys
from rclpy.node import Node
from pam_ros.node_help import NodeHelp
from pam_ros.spin import spin_node
from pam_ros.unforeseen import BROKEN

class Drawer(Node):
    def __init__(self):
        super().__init__("drawer")
        self.create_timer(0.01, self.turn)

    def turn(self):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))
        print("turned", flush=True)

usage = NodeHelp(program="", purpose="", parameters=[], other_keys="", example="", publishes=[])
sys.exit(spin_node(Drawer, usage, [], mistake=ValueError))
"""


def test_ctrl_c_that_arrives_twice_does_not_abort_a_node_in_a_callback(tmp_path: Path) -> None:
    """The terminal and launch both send it; an exception out of a callback ends in C++."""
    file = tmp_path / "drawer.py"
    file.write_text(SIGNALLED_IN_A_CALLBACK)
    ended = subprocess.run(
        [sys.executable, str(file)], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert (ended.returncode, ended.stdout) == (0, "turned\n"), ended.stderr


def test_a_node_that_no_signal_has_ended_leaves_the_handlers_as_they_were() -> None:
    before = signal.getsignal(signal.SIGINT)
    with EndSignals():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_signals_close_together_are_one_request_to_end() -> None:
    """A second request cuts the lowering of the arm short; launch sends two signals at once."""
    now = [10.0]
    with EndSignals(lambda: now[0]) as signals:
        assert not signals.asked
        for seconds, urgent in ((0.0, False), (0.3, False), (0.5, False), (0.5, True)):
            now[0] += seconds
            os.kill(os.getpid(), signal.SIGINT)
            assert (signals.asked, signals.urgent) == (True, urgent)
        with pytest.raises(KeyboardInterrupt), signals.interruptible():
            os.kill(os.getpid(), signal.SIGTERM)


def test_a_later_signal_interrupts_a_node_that_takes_long_to_make(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(end_signals, "ONE_REQUEST", 0.0)

    def make_node() -> None:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
        time.sleep(30.0)
        raise AssertionError("the second signal was ignored")

    assert spin_node(make_node, HELP, [], mistake=MisreadDrawingError) == 0


def test_the_second_signal_of_ctrl_c_does_not_kill_a_process_that_is_ending() -> None:
    """It came while Python freed the last objects, and launch said that the process had died."""
    program = (
        "import os, signal\n"
        "from pam_ros.end_signals import EndSignals\n"
        "class Last:\n"
        "    def __del__(self, kill=os.kill, me=os.getpid(), number=signal.SIGINT):\n"
        "        kill(me, number)\n"
        "last = Last()\n"
        "with EndSignals() as signals:\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "print(signals.asked)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert (ended.returncode, ended.stdout.strip()) == (0, "True")
