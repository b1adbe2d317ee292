"""The example of a mapped device in config/, and changes of its section for tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pam_driver.boards.mapped.board import MappedBoard
from pam_driver.boards.mapped.reader import MappedDeviceReader
from pam_driver.boards.wiring import RigWiring
from pam_model.rig import Rig, load_rig
from support.rigs import CONFIG

ELBOW_VENDOR = CONFIG / "elbow_vendor_dbc.yaml"
Change = Callable[[dict[str, Any]], None]


def vendor_dbc() -> Path:
    """The DBC file of the example."""
    return CONFIG / "pneumatic_manifold.dbc"


def board_of(path: Path) -> MappedBoard:
    """The only board of a rig file."""
    (board,) = RigWiring(load_rig(path)).make_boards().values()
    assert isinstance(board, MappedBoard)
    return board


def nested(tree: Any) -> Any:
    """A copy whose mappings can be changed."""
    return (
        {key: nested(value) for key, value in tree.items()} if isinstance(tree, Mapping) else tree
    )


def changed(rig: Rig, change: Change) -> Rig:
    """A rig whose only board has a changed section."""
    ((name, section),) = rig.boards.items()
    section = nested(section)
    change(section)
    return replace(rig, boards={name: section})


def problems_after(rig: Rig, change: Change) -> list[str]:
    """What is wrong with the section of a rig's only board after a change."""
    return RigWiringProblems(changed(rig, change)).lines


class RigWiringProblems:
    """The lines with which the kind refuses a rig's boards."""

    def __init__(self, rig: Rig) -> None:
        wired = RigWiring(rig, kinds={"mapped": _AcceptsAll}).boards
        self.lines = [
            line for board in wired.values() for line in MappedDeviceReader(board).problems
        ]


class _AcceptsAll:
    def __init__(self, options: object) -> None:
        pass

    def problems(self, wired: object) -> list[str]:
        return []
