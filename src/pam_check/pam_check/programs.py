"""The programs that checks start as processes of their own, by the module that `python -m` runs.

Modules are named in text nowhere else: what is imported is imported by an import statement, so that
the rules about imports see it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

MODULES: Final[Mapping[str, str]] = {
    "rig": "pam_sim.rig_node",
    "driver": "pam_driver.driver_node",
    "model": "pam_model.model_node",
    "controller": "pam_control.controller_node",
}
"""The nodes of a simulated rig, in the order in which they start."""

DIAGNOSIS: Final = "pam_gap"
DRAW_CASES: Final = "pam_check.blind.cases"
CARRY_OUT_EXPERIMENT: Final = "pam_check.blind.carry_out"
