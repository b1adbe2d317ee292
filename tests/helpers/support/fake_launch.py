"""Stands in for ROS 2's launch, which the package index does not have.

Launch files run with it, but nothing is started: every object of launch keeps what it was made of.
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

NAMES = {
    "launch": ("Action", "LaunchContext", "LaunchDescription"),
    "launch.actions": (
        "DeclareLaunchArgument", "EmitEvent", "ExecuteProcess", "IncludeLaunchDescription",
        "LogInfo", "OpaqueFunction", "RegisterEventHandler", "TimerAction",
    ),
    "launch.conditions": ("IfCondition", "UnlessCondition"),
    "launch.event_handlers": ("OnProcessExit",),
    "launch.events": ("Shutdown",),
    "launch.events.process": ("ProcessExited",),
    "launch.substitutions": ("Command", "LaunchConfiguration", "PathJoinSubstitution"),
    "launch_ros": (),
    "launch_ros.actions": ("Node",),
    "launch_ros.parameter_descriptions": ("ParameterValue",),
    "launch_ros.substitutions": ("FindPackageShare",),
}  # fmt: skip


class Recorded:
    """An object of launch: what it is and what it was made of.

    Attributes
    ----------
    kind : str
        Name of its class in launch.
    given : tuple
        Positional arguments.
    words : dict
        Keyword arguments.
    """

    kind = ""

    def __init__(self, *given: Any, **words: Any) -> None:
        self.given = given
        self.words = words

    def perform(self, context: Any) -> str:
        """The value of a LaunchConfiguration in a context that is a mapping."""
        return str(context.launch_configurations[self.given[0]])

    def get_launch_arguments(self) -> list[Any]:
        """The arguments that a LaunchDescription declares."""
        return [SimpleNamespace(name=one.given[0]) for one in all_of("DeclareLaunchArgument", self)]

    def __getitem__(self, name: str) -> Any:
        return self.words[name]


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `import launch` find this module's stand-ins until the test ends."""
    for module_name, names in NAMES.items():
        module = ModuleType(module_name)
        for name in names:
            setattr(module, name, type(name, (Recorded,), {"kind": name}))
        monkeypatch.setitem(sys.modules, module_name, module)


def run_launch_file(path: Path) -> dict[str, Any]:
    """The names that a launch file defines; needs `install` before."""
    return runpy.run_path(str(path))


def all_of(kind: str, thing: Any) -> list[Recorded]:
    """Every object of one kind in a launch description, however deep, each once."""
    found: list[Recorded] = []
    for one in _parts(thing):
        if one.kind == kind and not any(one is other for other in found):
            found.append(one)
    return found


def _parts(thing: Any) -> Iterator[Recorded]:
    if isinstance(thing, Recorded):
        yield thing
        yield from _parts(thing.given)
        yield from _parts(list(thing.words.values()))
    elif isinstance(thing, list | tuple):
        for one in thing:
            yield from _parts(one)
    elif isinstance(thing, dict):
        yield from _parts(list(thing.values()))


def plain(value: Any) -> Any:
    """The name of the launch argument that gives a value, where it is not written down."""
    if isinstance(value, Recorded) and value.kind in {"LaunchConfiguration", "ParameterValue"}:
        return plain(value.given[0])
    return value
