"""The programs of the suite that are started as processes, by the module that `python -m` runs.

This is the only place below the checks in which modules are named by strings. All imports are
import statements, so that the test of the import rules sees them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

MODULES: Final[Mapping[str, str]] = {
    "rig": "pam_sim.rig_node",
    "driver": "pam_driver.driver_node",
    "model": "pam_model.model_node",
    "controller": "pam_control.controller_node",
}
"""The nodes of a simulated rig, in the order in which they start."""

ROBOT: Final = "pam_robot"
ROBOT_COMMAND: Final = "node"
NODES_OF_ROBOT: Final[Mapping[str, str]] = {
    "driver": "pam_driver",
    "model": "pam_model",
    "controller": "pam_controller",
}
"""The program that runs three of these nodes in one process, and their names there."""

DEMO: Final = "pam_demo"
RECORDER: Final = "pam_gap"
"""Its command `record`."""


def recorder_words(rig: str | Path, bag: str | Path, priority: int = 0) -> list[str]:
    """Arguments of `RECORDER` for all topics of a robot."""
    words = ["record", "--all", "--rig", str(rig), "--out", str(bag)]
    return [*words, "--realtime-priority", str(priority)]
