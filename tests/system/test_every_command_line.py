"""Every tool and node answers a wrong command line in one line with exit code 2, and --help with 0.

The cases are made of the tools' own tables of commands, so that a new command or option is among
them without being named here.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import entry_points
from pathlib import Path

import pytest

import pam_model as models
from pam_bringup.__main__ import main as pam_bringup
from pam_bringup.viewer import markers_node
from pam_check.__main__ import main as pam_check
from pam_cli.__main__ import main as pam_cli
from pam_control import controller_node
from pam_control.__main__ import main as pam_control
from pam_demo.__main__ import main as pam_demo
from pam_demo.chain import private_domain, set_environment
from pam_driver import driver_node
from pam_driver.__main__ import main as pam_driver
from pam_gap.__main__ import main as pam_gap
from pam_gap.experiments import play_node
from pam_gap.live import monitor_node
from pam_model import argument_types, model_node
from pam_model.__main__ import main as pam_model
from pam_model.command_line import Command, NodeCommand
from pam_robot.__main__ import _node as robot_node
from pam_robot.__main__ import main as pam_robot
from pam_ros.program_name import PROGRAM
from pam_sim import rig_node
from pam_sim.__main__ import main as pam_sim
from support.rigs import ELBOW
from support.source_tree import ROOT, imported_names, modules

Main = Callable[[Sequence[str]], int]
TOOLS: dict[str, Main] = {
    "pam_model": pam_model,
    "pam_driver": pam_driver,
    "pam_sim": pam_sim,
    "pam_gap": pam_gap,
    "pam_check": pam_check,
    "pam_demo": pam_demo,
    "pam_bringup": pam_bringup,
    "pam_control": pam_control,
    "pam_robot": pam_robot,
}
EVERY = [(tool, each) for tool in TOOLS for each in sys.modules[f"{tool}.__main__"].COMMANDS]
COMMANDS = [(tool, each) for tool, each in EVERY if isinstance(each, Command)]
NODE_COMMANDS = [(tool, each) for tool, each in EVERY if isinstance(each, NodeCommand)]
PROGRAMS = sorted(
    str(Path(sys.executable).with_name(entry.name))
    for entry in entry_points(group="console_scripts")
    if entry.value.split(".")[0] in TOOLS
)
"""Every program that the packages install, those of `ros2 run` among them."""
NODES = {
    "driver": driver_node.main,
    "controller": controller_node.main,
    "model": model_node.main,
    "robot": robot_node,
    "rig": rig_node.main,
    "monitor": monitor_node.main,
    "play": play_node.main,
    "markers": markers_node.main,
}
HEAVY = {
    "numpy",
    "scipy",
    "pandas",
    "numba",
    "matplotlib",
    "rclpy",
    "can",
    "cantools",
    "tqdm",
    "canopen",
}
LONGEST_HELP = 0.3  # s of processor time, which other programs do not lengthen


def actions(command: Command) -> list[argparse.Action]:
    """What a command declares."""
    parser = argparse.ArgumentParser(add_help=False)
    command.declare(parser)
    return list(parser._actions)  # argparse offers no other way to see them


def kind(action: argparse.Action) -> str:
    """Name of the type of an argument, such as `input_file`."""
    return "" if action.type is None else action.type.__qualname__.split(".")[0]


def wrong_values(kind: str, folder: Path) -> list[str]:
    """Values that an argument of a type must refuse."""
    file, missing = folder / "file", folder / "missing"
    file.write_text("")
    return {
        "count": ["-1", "1.5", "many", ""],
        "number": ["nan", "many", ""],
        "names": ["Elbow", "a,a", "1st", ""],
        "one_of": ["none of them", ""],
        "muscle_size": ["DMSP-15", "20", ""],
        "named_number": ["x=abc", "x"],
        "input_path": [str(missing)],
        "input_file": [str(missing), str(folder)],
        "input_folder": [str(missing), str(file)],
        "output_file": [str(folder), str(file / "below")],
        "new_file": [str(folder), str(file / "below"), str(file)],
        "output_folder": [str(file), str(file / "below")],
        "": [],
    }[kind]


def refused(main: Main, arguments: Sequence[str], capfd: pytest.CaptureFixture[str]) -> str:
    """The one line in which a command line is refused."""
    code = main(arguments)
    told = capfd.readouterr()
    assert code == 2, (arguments, told)
    assert told.out == "", arguments
    lines = told.err.splitlines()
    assert len(lines) == 1, (arguments, told.err)
    assert lines[0].startswith("error: ")
    return lines[0]


each_tool = pytest.mark.parametrize("tool", TOOLS)
each_command = pytest.mark.parametrize(
    ("tool", "command"), COMMANDS, ids=[f"{tool} {command.name}" for tool, command in COMMANDS]
)
each_node = pytest.mark.parametrize("node", NODES)


@each_tool
def test_a_tool_without_a_command_says_what_it_wants(tool, capfd):
    commands = [command.name for owner, command in COMMANDS if owner == tool]
    if tool not in ("pam_demo", "pam_bringup"):  # which have a default
        assert "COMMAND" in refused(TOOLS[tool], [], capfd)
    line = refused(TOOLS[tool], ["nonsense"], capfd)
    assert all(name in line for name in commands)
    assert TOOLS[tool](["--help"]) == 0
    told = capfd.readouterr().out
    assert all(name in told for name in commands)


@each_tool
def test_a_tool_tells_its_version_with_and_without_a_command(tool, capfd):
    names = [command.name for owner, command in COMMANDS if owner == tool]
    for words in ([], *([name] for name in names)):
        assert TOOLS[tool]([*words, "--version"]) == 0
        assert capfd.readouterr() == (f"{tool} {models.__version__}\n", "")


def test_every_package_with_a_program_is_tried_here():
    programs = {name.split(".")[0] for name in modules() if name.endswith(".__main__")}
    assert programs - {"pam_cli"} == set(TOOLS)


def test_pam_names_every_tool_and_runs_its_commands(capfd):
    assert pam_cli(["--help"]) == 0
    told = capfd.readouterr().out
    assert all(f"\n    {tool[4:]} " in told for tool in TOOLS)
    for tool, command in COMMANDS:
        assert pam_cli([tool[4:], command.name, "--help"]) == 0
        usage = capfd.readouterr().out
        assert usage.startswith(f"usage: {PROGRAM} {tool[4:]} {command.name} ")
        assert "python -m" not in usage
    assert "did you mean gap?" in refused(pam_cli, ["gapp"], capfd)
    assert "did you mean diagnose?" in refused(pam_cli, ["gap", "diagnoze"], capfd)
    assert pam_cli(["--version"]) == 0


def test_no_message_names_a_form_of_the_command_that_a_fresh_shell_does_not_have():
    """Modules that are internal to a command are named as modules."""
    internal = ("pam_check.blind.", "<package>", "python -m module")
    for name, path in modules().items():
        for line in path.read_text(encoding="utf-8").splitlines():
            if "python -m " in line:
                assert any(one in line for one in internal), f"{name}: {line}"


@each_command
def test_help_of_a_command_names_all_its_options(tool, command, capfd):
    assert TOOLS[tool]([command.name, "--help"]) == 0
    told = capfd.readouterr().out
    options = [option for action in actions(command) for option in action.option_strings]
    options += ["--json", "--version"] + ["--check"] * bool(command.bad_news)
    assert all(option in told for option in options)


@each_command
def test_every_argument_refuses_what_it_cannot_use(tool, command, tmp_path, capfd):
    refused(TOOLS[tool], [command.name, "--nonsense"], capfd)
    before: list[str] = []  # positional arguments ahead of the one that is wrong
    for action in actions(command):
        assert action.type is None or hasattr(argument_types, kind(action)), (
            f"{action.dest}: a bare {action.type} lets in what the command cannot use"
        )
        for value in wrong_values(kind(action), tmp_path):
            wrong = [action.option_strings[0]] if action.option_strings else before
            line = refused(TOOLS[tool], [command.name, *wrong, value], capfd)
            assert value in line
            assert not action.option_strings or action.option_strings[0] in line
        if action.required and action.option_strings:
            line = refused(TOOLS[tool], [command.name], capfd)
            assert action.option_strings[0] in line
        if not action.option_strings:
            before = [*before, str(ELBOW) if "input" in kind(action) else "name"]


# what else a command needs before it reads its --rig
BESIDE_A_RIG = {
    "calibrate": [str(ELBOW), "--out", "out"],
    "commission": ["--out", "out"],
    "diagnose": [str(ELBOW), "--out", "out"],
    "fleet": [".", "--out", "out"],
    "fuzz": ["frames"],
    "import": [str(ELBOW), "--out", "out"],
    "record": ["--out", "out"],
    "layouts": ["out"],
    "security": ["policy.xml"],
}


@each_command
def test_an_empty_rig_file_is_named(tool, command, tmp_path, capfd, monkeypatch):
    if not any(action.dest == "rig" for action in actions(command)):
        pytest.skip("takes no rig")
    monkeypatch.chdir(tmp_path)
    empty = tmp_path / "empty.yaml"
    empty.write_text("")
    arguments = [command.name, *BESIDE_A_RIG.get(command.name, []), "--rig", str(empty)]
    assert "empty.yaml" in refused(TOOLS[tool], arguments, capfd)


@pytest.mark.parametrize(
    ("tool", "arguments", "told"),
    [
        ("pam_gap", ["blind", "--cases", "0"], "pam check blind"),
        ("pam_gap", ["close-loop"], "pam demo close-loop"),
        ("pam_check", ["blind", "--cases", "0"], "--cases: 0"),
        ("pam_check", ["faults", "--kind", "encoder_stuk"], "encoder_stuck"),
        ("pam_check", ["processes", "--kind", "nonsense"], "nonsense"),
        ("pam_check", ["fuzz", "nonsense"], "frames"),
        ("pam_check", ["lifecycle", "--cycles", "10", "--unplugged", "5"], "--unplugged 5"),
        ("pam_demo", ["close-loop", "--hide", "x=abc"], "--hide x=abc"),
        ("pam_demo", ["close-loop", "--hide", "x=1"], "effect"),
        ("pam_demo", ["--true-effects", "x=abc"], "--true-effects x=abc"),
        ("pam_gap", ["diagnose", "--rig", str(ELBOW), "--out", "out"], "no recording"),
        ("pam_gap", ["diagnose", "empty.csv", "--rig", str(ELBOW), "--out", "out"], "empty.csv"),
        ("pam_gap", ["diagnose", "folder", "--rig", str(ELBOW), "--out", "out"], "folder"),
        ("pam_model", ["fit", "tondu_lopez", "empty.csv"], "empty.csv"),
        ("pam_model", ["compare", "empty.csv"], "empty.csv"),
        ("pam_model", ["show", "nonsense"], "nonsense"),
        ("pam_model", ["show", "gaylord", "--output", "picture.nonsense"], "nonsense"),
        ("pam_sim", ["rig", "--rig", str(ELBOW), "--dbc", "empty.csv"], "empty.csv"),
        ("pam_sim", ["rig", "--rig", str(ELBOW), "--effect", "x=1"], "effect"),
        ("pam_check", ["fault-tables", "empty.csv"], "pam check pages"),
        ("pam_check", ["pages", "folder"], "folder"),
        ("pam_model", ["gallery"], "pam check pages"),
        ("pam_driver", ["check-rig", "empty.csv"], "empty.csv"),
        ("pam_driver", ["monitor", "empty.csv"], "empty.csv"),
        ("pam_driver", ["scan", "--channel", "no_such_bus"], "no_such_bus"),
        ("pam_driver", ["check-rig", str(ELBOW), "--dbc", "empty.csv"], "empty.csv"),
    ],
)
def test_a_mistake_that_shows_later_is_one_line_as_well(
    tool, arguments, told, tmp_path, capfd, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "folder").mkdir()
    assert told in refused(TOOLS[tool], arguments, capfd)


@pytest.mark.parametrize(
    ("tool", "arguments"),
    [
        ("pam_model", ["list"]),
        ("pam_model", ["show", "gaylord"]),
        ("pam_model", ["design", "--force", "100", "--stroke", "0.03", "--pressure", "3e5"]),
        ("pam_bringup", ["security", "policy.xml", "--rig", str(ELBOW)]),
        ("pam_check", ["fuzz", "frames", "--count", "1000", "--rig", str(ELBOW)]),
    ],
)
def test_json_is_the_only_thing_on_standard_output(tool, arguments, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert TOOLS[tool]([*arguments, "--json"]) == 0
    told = capfd.readouterr()
    assert json.loads(told.out)
    assert told.err == ""  # no progress bar where nobody looks


def asked_for_help(words: Sequence[str]) -> float:
    """Processor time of a program that prints its help [s]."""
    before = os.times()
    subprocess.run([*words, "--help"], capture_output=True, check=True)
    after = os.times()
    now, then = (each.children_user + each.children_system for each in (after, before))
    return now - then


def test_help_loads_nothing_heavy_and_takes_less_than_a_third_of_a_second():
    lines = [f"from {tool}.__main__ import main as {tool}" for tool in TOOLS]
    lines += [
        f"{tool}(['{command.name}', '--help'])" for tool, command in (*COMMANDS, *NODE_COMMANDS)
    ]
    lines += ["import sys", "print('LOADED', *{name.split('.')[0] for name in sys.modules})"]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.rpartition("LOADED")[2].split())
    assert loaded & HEAVY == set()
    for words in ([], *([tool[4:]] for tool in TOOLS)):
        assert asked_for_help([str(ROOT / "pam"), *words]) < LONGEST_HELP, words
    for program in PROGRAMS:
        assert asked_for_help([program]) < LONGEST_HELP, program


def test_the_page_of_exit_codes_names_every_command_with_a_check():
    page = (ROOT / "docs" / "exit_codes.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `./pam ")]
    named = {
        (tool, command.name)
        for tool, command in COMMANDS
        for row in rows
        if (f"./pam {tool[4:]} " in row and f"{command.name}`" in row)
        or (f"./pam {tool[4:]}`" in row and command.name == "run")
    }
    assert named == {(tool, command.name) for tool, command in COMMANDS if command.bad_news}


def test_one_module_parses_all_command_lines_and_draws_all_progress_bars():
    allowed = {"pam_model.command_line", "pam_model.argument_types"}
    users = {
        name: imported_names(path) & {"argparse", "optparse", "click", "typer", "tqdm"}
        for name, path in modules().items()
        if name not in allowed
    }
    assert {name: found for name, found in users.items() if found} == {}


@pytest.mark.parametrize(
    ("line", "answers"),
    [
        ("pam ga", ["gap"]),
        ("pam gap dia", ["diagnose"]),
        ("pam model braid --an", ["--angle"]),
        ("pam sim --v", ["--version"]),
        ("pam check faults --ch", ["--check"]),
    ],
)
def test_the_shell_learns_how_a_command_line_goes_on(line, answers, tmp_path):
    pytest.importorskip("argcomplete", reason="completion is optional")
    answer = tmp_path / "answer"
    asked = {
        "_ARGCOMPLETE": "1",  # the words before the arguments
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
    }
    subprocess.run([ROOT / "pam"], env=os.environ | asked, check=True, timeout=60.0)
    assert [word.strip() for word in answer.read_text().splitlines()] == answers


# --- nodes -----------------------------------------------------------------------------------


@pytest.fixture
def as_before() -> Iterator[None]:
    """The signals and the interpreter's switch interval, which a node's start changes."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    interval = sys.getswitchinterval()
    with set_environment(private_domain()):
        yield
    sys.setswitchinterval(interval)
    for number, handler in handlers.items():
        signal.signal(number, handler)


@each_node
@pytest.mark.usefixtures("as_before")
def test_help_of_a_node_tells_parameters_topics_and_an_example(node, capfd):
    assert NODES[node](["--help"]) == 0
    told = capfd.readouterr()
    assert told.err == ""
    # a robot is three nodes, and names them in place of their topics
    topics = ("their own --help",) if node == "robot" else ("subscribes:", "publishes:")
    for text in (f"usage: {PROGRAM} ", *topics, "parameters:", "example:"):
        assert text in told.out
    assert "docs/rig_file.md" in told.out


@each_node
@pytest.mark.usefixtures("as_before")
def test_a_node_tells_its_version(node, capfd):
    assert NODES[node](["--version"]) == 0
    package = NODES[node].__module__.partition(".")[0]
    assert capfd.readouterr() == (f"{package} {models.__version__}\n", "")


@each_node
@pytest.mark.usefixtures("as_before")
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "no rig"),
        (["--nonsense"], "--nonsense"),
        (["nonsense"], "nonsense"),
        (["--ros-args", "--nonsense"], "--nonsense"),
        (["--ros-args", "--params-file", "missing.yaml"], "missing.yaml: no such file"),
        (["--ros-args", "--params-file", "folder"], "folder: is a folder"),
        (["--ros-args", "--params-file", "empty.yaml"], "no rig"),
        (["--ros-args", "--params-file", "text.yaml"], "text.yaml"),
        (["--ros-args", "--params-file", str(ELBOW), "-p", "nonsense:=1"], "nonsense"),
    ],
)
def test_a_node_refuses_a_wrong_start_in_one_line(node, words, told, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty.yaml").write_text("")
    (tmp_path / "text.yaml").write_text("a: [\n")
    assert told in refused(NODES[node], words, capfd)
