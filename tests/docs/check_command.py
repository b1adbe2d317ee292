"""Whether a command on a page is one that the suite, or a known program, would take.

A command of the suite is parsed by its own parser, with file names left unopened. Commands of
other programs are not run here: they need a robot, a ROS installation or root.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import itertools
import re
import shlex
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import entry_points
from typing import Any

import yaml

from pam_bringup.launch_arguments import ARGUMENTS, OF_SIMULATION
from pam_bringup.viewer import markers_help
from pam_control import controller_help, controller_parameters
from pam_driver import driver_parameters
from pam_gap.experiments import play_help
from pam_gap.live import monitor_help
from pam_model import model_help
from pam_model.command_line import NodeCommand, Tool
from pam_robot import robot_help, robot_node
from pam_ros.node_arguments import arguments_by_node
from pam_ros.node_help import NodeHelp
from pam_sim import rig_help

from .pages import ROOT

OTHER_PROGRAMS = {
    "sudo": "changes the machine",
    "candump": "needs a CAN interface",
    "cantools": "needs frames from candump",
    "ip": "needs a CAN interface",
    "echo": "shell",
    "export": "shell",
    "source": "shell",
    "cp": "shell",
    "sed": "shell",
    "git": "version control",
    "rosdep": "needs a ROS installation",
    "firmware/out/pam_board": "tests/firmware builds and runs it",
    "colcon": "tests/system builds the workspace",
}
ROS2_VERBS = {"bag", "lifecycle", "security", "node", "param", "interface"}
"""Of the real command line, which is not installed here; names of topics are checked below."""
RECORDED = {
    "valve_commands", "sent_valve_commands", "pressure_states", "joint_states", "muscle_states",
    "supply_pressure",
}  # fmt: skip
PATH_TYPES = {"input_file", "input_path", "input_folder", "output_file", "output_folder"}
CONTROLLER = replace(
    controller_help.HELP, parameters=controller_parameters.parameter_table(("<joint>",))
)
"""With the parameters, which its own help leaves to `pam control parameters`."""
NODES = (
    driver_parameters.HELP, CONTROLLER, model_help.HELP, rig_help.HELP,
    monitor_help.HELP, play_help.HELP, markers_help.HELP, robot_help.HELP,
)  # fmt: skip


IN_ONE_PROCESS = (driver_parameters.HELP, CONTROLLER, model_help.HELP)


class _WrongError(Exception):
    """What a parser of the suite says of a command."""


class _IncompleteError(_WrongError):
    """Something that the command needs is left out."""


def problem_of(command: str, *, is_complete: bool = True) -> str | None:
    """What is wrong with a command; None if nothing is.

    A command within a sentence is not `is_complete`: it may leave out what it needs to run.
    """
    for part in re.split(r"\s\|\s", command):
        try:
            words = shlex.split(re.sub(r"\$\([^)]*\)", "PLACEHOLDER", part))
        except ValueError as error:
            return f"{command}: {error}"
        while words and re.match(r"^\w+=", words[0]):
            words = words[1:]
        try:
            if words and "<" not in part:
                _check(words)
        except _IncompleteError as wrong:
            if is_complete:
                return f"{command}: {wrong}"
        except _WrongError as wrong:
            return f"{command}: {wrong}"
    return None


def _check(words: list[str]) -> None:
    program = words[0]
    checks: dict[str, Callable[[list[str]], None]] = {
        "./pam": _pam, ".venv/bin/python": _python, "ros2": _ros2, "make": _make,
    }  # fmt: skip
    if program in checks:
        checks[program](words[1:])
    elif program.startswith("tools/"):
        _file(program)
    elif program not in OTHER_PROGRAMS:
        raise _WrongError(f"{program} is neither a program of the suite nor a known one")


def _file(name: str) -> None:
    if not (ROOT / name).exists():
        raise _WrongError(f"there is no {name}")


def _make(words: list[str]) -> None:
    folder = ROOT
    if words[:1] == ["-C"]:
        folder, words = ROOT / words[1], words[2:]
    text = (folder / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", text, re.MULTILINE))
    for word in words:
        if "=" not in word and word not in targets:
            raise _WrongError(f"make has no target {word}")


def _pam(words: list[str]) -> None:
    tools = {entry.name: entry for entry in entry_points(group="pam.tools")}
    if words in (["--version"], ["--help"]):  # of every program
        return
    if not words:
        raise _IncompleteError("./pam without a tool")
    if words[0] not in tools:
        raise _WrongError(f"pam has no tool {words[0]}; it has {', '.join(tools)}")
    _tool(tools[words[0]].load(), words[1:])


def _python(words: list[str]) -> None:
    if words and words[0] == "-m" and len(words) > 1:
        _module(words[1])
    elif words:
        _file(words[0])
    else:
        raise _IncompleteError("python without a program")


def _module(name: str) -> None:
    if name.startswith("pam_"):
        raise _WrongError(f"{name} is a part of the suite; its commands begin with ./pam")
    if importlib.util.find_spec(name.partition(".")[0]) is None:
        raise _WrongError(f"there is no package {name}")


def _tool(tool: Tool, words: list[str]) -> None:
    """Parse the words as the tool would, but for whether files exist."""
    by_name = {command.name: command for command in tool.commands}
    if words in (["--version"], ["--help"]):
        return
    if words and words[0] in by_name:
        command, words = by_name[words[0]], words[1:]
    elif tool.default and (not words or words[0].startswith("-")):
        command = by_name[tool.default]
    elif not words:
        raise _IncompleteError(f"no command; there are {', '.join(by_name)}")
    else:
        raise _WrongError(f"no command {words[0]}; there are {', '.join(by_name)}")
    if isinstance(command, NodeCommand):
        program = f"{tool.program} {command.name}"
        _node(next(usage for usage in NODES if usage.program == program), words)
        return
    parser = _Parser(allow_abbrev=False)
    command.declare(parser)
    parser.add_argument("--json", action="store_true")
    if command.bad_news:
        parser.add_argument("--check", action="store_true")
    for action in parser._actions:
        if getattr(action.type, "__name__", "") in PATH_TYPES:
            action.type = str
    parser.parse_args(words)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> Any:
        raise _IncompleteError(message) if "are required" in message else _WrongError(message)


def _node(usage: NodeHelp, words: list[str]) -> None:
    """Check the parameters that a node is given by -p."""
    if usage is robot_help.HELP:
        _, by_node = arguments_by_node(words, robot_node.NODES)
        for part in IN_ONE_PROCESS:
            _node(part, by_node[f"pam_{part.program.split()[-2]}".replace("control", "controller")])
        return
    names = {parameter.name for parameter in usage.parameters}
    for flag, word in itertools.pairwise(words):
        name = word.partition(":=")[0].partition(":")[0]
        if flag == "-p" and name not in names:
            raise _WrongError(f"{usage.program} has no parameter {name}")


def _ros2(words: list[str]) -> None:
    if len(words) < 2:
        raise _IncompleteError("ros2 with a verb alone")
    verb, rest = words[0], words[1:]
    if verb == "run":
        _ros2_run(rest)
    elif verb == "launch":
        _ros2_launch(rest)
    elif verb in ("topic", "service"):
        _ros2_message(verb, [word for word in rest if not word.startswith("-")])
    elif verb == "bag" and rest[:1] == ["record"]:
        topics = set(rest[rest.index("recording") + 1 :])
        if topics - RECORDED:
            raise _WrongError(f"no topics of the suite: {', '.join(sorted(topics - RECORDED))}")
    elif verb not in ROS2_VERBS:
        raise _WrongError(f"ros2 has no verb {verb}")


def _ros2_run(words: list[str]) -> None:
    """The page on installing names one, and says that ./pam is the form of all pages."""
    package, program = words[0], words[1] if len(words) > 1 else ""
    scripts = entry_points(group="console_scripts")
    known = [entry.name for entry in scripts if entry.module == f"{package}.__main__"]
    if program not in known:
        raise _WrongError(f"{package} has no program {program}; it has {', '.join(known)}")


def _ros2_launch(words: list[str]) -> None:
    package, file = words[0], words[1]
    rest = [word for word in words[2:] if not word.startswith("--")]
    path = ROOT / "src" / package / "launch" / file
    if not path.exists():
        raise _WrongError(f"{package} has no launch file {file}")
    known = OF_SIMULATION if file == "simulation.launch.py" else tuple(ARGUMENTS)
    for word in rest:
        name, given, _ = word.partition(":=")
        if not given or name not in known:
            raise _WrongError(f"{file} has no argument {word}; it has {', '.join(sorted(known))}")


def _ros2_message(verb: str, words: list[str]) -> None:
    """`topic pub TOPIC TYPE TEXT` and `service call NAME TYPE [TEXT]`."""
    if words[0] not in ("pub", "call"):
        return
    words = [word for word in words[1:] if word != "1"]  # the number behind -w
    kind, text = words[1], words[2] if len(words) > 2 else "{}"
    package, _, name = kind.replace("/", ".").rpartition(".")
    module = package if package.endswith((".msg", ".srv")) else f"{package}.msg"
    try:
        found = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError):
        raise _WrongError(f"there is no type {kind}") from None
    if text != "PLACEHOLDER":
        _fields(found if verb == "topic" else found.Request, yaml.safe_load(text), kind)


def _fields(message: Any, given: Any, where: str) -> None:
    if not isinstance(given, dict):
        return
    known = message.get_fields_and_field_types()
    for key, value in given.items():
        if key not in known:
            raise _WrongError(f"{where} has no field {key}")
        inner = re.sub(r"^sequence<([^,>]+).*|\[\d*\]$", r"\1", known[key])
        if "/" in inner:
            package, _, name = inner.partition("/")
            kind = getattr(importlib.import_module(f"{package}.msg"), name)
            for one in value if isinstance(value, list) else [value]:
                _fields(kind, one, inner)
