"""Ctrl-C and SIGTERM end every program at any moment in one line, without a traceback."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pam_model.command_line import Command, Outcome, run_command
from pam_model.program_signals import Terminated, interruptible, postponed
from support.source_tree import ROOT, modules

NUMBERS = (signal.SIGINT, signal.SIGTERM)
PROGRAMS = [
    name
    for name, path in modules().items()
    if '\nif __name__ == "__main__":' in path.read_text(encoding="utf-8")
]
ENTRY_POINTS = [
    ("pam_driver", "driver_node"),
    ("pam_control", "controller_node"),
    ("pam_model", "model_node"),
    ("pam_sim", "rig_node"),
    ("pam_gap", "monitor"),
    ("pam_gap", "play"),
    ("pam_bringup", "markers"),
]

# A signal is sent when the n-th module is imported: the same moment on a busy machine and on an
# idle one. The first ten belong to Python itself and to the package.
SIGNALLED = """
import os, sys
number, left, *words = sys.argv[1:]
left = int(left)

def count(event, arguments):
    global left
    if event == "import":
        left -= 1
        if left == 0:
            os.kill(os.getpid(), int(number))

sys.argv = words
sys.addaudithook(count)
"""
AS_A_MODULE = (
    SIGNALLED + "import runpy\nrunpy.run_module(words[0], run_name='__main__', alter_sys=True)\n"
)
AS_AN_ENTRY_POINT = (
    SIGNALLED + "from {package}.__main__ import {function}\nsys.exit({function}())\n"
)


def ends_quietly(program: str, number: int, left: int, words: list[str]) -> None:
    """Run Python code, send it a signal, and check how it ends."""
    ended = subprocess.run(
        [sys.executable, "-c", program, str(int(number)), str(left), *words],
        capture_output=True, text=True, timeout=60.0, check=False, cwd=ROOT,
    )  # fmt: skip
    assert (ended.returncode, ended.stderr) == (128 + number, "stopped\n"), ended.stdout


@pytest.mark.sampled("six of the programs, which all begin in the same way", cases=6)
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("program", PROGRAMS)
def test_a_signal_at_the_first_import_is_one_line(program: str, number: int) -> None:
    ends_quietly(AS_A_MODULE, number, 12, [program, "--help"])


@pytest.mark.sampled("two of the nodes, at either moment", cases=2)
@pytest.mark.parametrize("left", [150, 300])
@pytest.mark.parametrize("program", [name for name in PROGRAMS if name.endswith("_node")])
def test_a_signal_in_the_middle_of_the_imports_of_a_node_is_one_line(
    program: str, left: int
) -> None:
    ends_quietly(AS_A_MODULE, signal.SIGINT, left, [program, "--help"])


@pytest.mark.sampled("two of the seven entry points, which one function makes", cases=2)
@pytest.mark.parametrize(("package", "function"), ENTRY_POINTS)
def test_a_signal_while_ros2_run_imports_a_node_is_one_line(package: str, function: str) -> None:
    pytest.importorskip("rclpy")
    program = AS_AN_ENTRY_POINT.format(package=package, function=function)
    ends_quietly(program, signal.SIGTERM, 250, ["program", "--ros-args"])


@pytest.mark.sampled("one of the three moments", cases=1)
@pytest.mark.parametrize("left", [80, 300, 500])
def test_a_signal_while_a_command_imports_its_modules_is_one_line(left: int) -> None:
    ends_quietly(AS_A_MODULE, signal.SIGINT, left, ["pam_check", "state-walk"])


def test_an_import_that_makes_another_error_of_an_interruption_is_not_interrupted(
    tmp_path: Path,
) -> None:
    """As extension modules do: the demo showed a traceback of one when Ctrl-C met its import."""
    (tmp_path / "converts.py").write_text(
        "import os, signal\n"
        "try:\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    sum(range(1000))\n"
        "except BaseException as error:\n"
        "    raise ImportError('initialization failed') from error\n"
    )
    program = (
        "import sys, time\n"
        "from pam_model.command_line import Command, run_command\n"
        "def run(given):\n"
        "    import converts\n"
        "    time.sleep(60.0)\n"
        "sys.exit(run_command(Command('c', 'converts', lambda parser: None, run), 'c'))\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True, text=True, timeout=30.0, check=False,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"},
    )  # fmt: skip
    assert (ended.returncode, ended.stderr) == (130, "stopped\n")


THAT_WAITS = """
import os, signal, sys, threading, time
from pam_demo.chain import private_domain
from pam_demo.player_node import open_player
from pam_model.command_line import Command, Outcome, run_command

def run(given):
    with open_player(("elbow",), private_domain()) as player:
        threading.Timer(0.3, os.kill, (os.getpid(), {number})).start()
        try:
            player.wait_for_controller(60.0, lambda: None)
        finally:
            print("ended", flush=True)

sys.exit(run_command(Command("play", "plays", lambda parser: None, run), "play"))
"""


@pytest.mark.parametrize("number", NUMBERS)
def test_a_signal_ends_the_demo_in_one_line_and_lets_it_end_its_nodes(number: int) -> None:
    """The handlers of rclpy closed the context under the player, which showed a traceback."""
    pytest.importorskip("rclpy")
    ended = subprocess.run(
        [sys.executable, "-c", THAT_WAITS.format(number=int(number))],
        capture_output=True, text=True, timeout=60.0, check=False,
    )  # fmt: skip
    expected = (128 + number, "ended\n", "stopped\n")
    assert (ended.returncode, ended.stdout, ended.stderr) == expected


def test_nothing_lets_rclpy_answer_signals() -> None:
    """Its handlers close the context in the middle of whatever runs."""
    for path in modules().values():
        text = path.read_text(encoding="utf-8")
        assert text.count("rclpy.init(") == text.count("signal_handler_options="), path


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_command_is_interrupted_by_both_signals_and_cleans_up(
    number: int, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {one: signal.getsignal(one) for one in NUMBERS}
    cleaned = []

    def run(given: object) -> Outcome:
        try:
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), number)
        finally:
            os.kill(os.getpid(), number)  # the same request: it must not end the cleaning
            cleaned.append(True)
        raise AssertionError("not interrupted")

    assert run_command(Command("run", "runs", lambda parser: None, run), "run", []) == code
    assert capsys.readouterr().err == "stopped\n"
    assert cleaned
    assert {one: signal.getsignal(one) for one in NUMBERS} == before


def test_a_later_signal_interrupts_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pam_model.program_signals.ONE_REQUEST", 0.0)
    with interruptible():
        for _ in range(2):
            with pytest.raises(Terminated):
                os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_signal_while_a_process_is_started_comes_after_it_is_known(number: int) -> None:
    """A node that the demo had just started was left running."""
    known = []
    with pytest.raises(KeyboardInterrupt), interruptible():
        with postponed():
            os.kill(os.getpid(), number)
            for _ in range(1000):
                known.append(len(known))  # the handler would run between two instructions
        time.sleep(30.0)
    assert len(known) == 1000
