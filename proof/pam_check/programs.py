"""The programs that only checks start as separate processes, besides `pam_demo.programs`."""

from __future__ import annotations

from typing import Final

DIAGNOSIS: Final = "pam_gap"
DIAGNOSE_CASES: Final = "pam_check.blind.diagnosing_process"
DRAW_CASES: Final = "pam_check.blind.cases"
CARRY_OUT_EXPERIMENT: Final = "pam_check.blind.carry_out"
