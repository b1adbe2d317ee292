"""The programs that the demo starts as separate processes, besides `pam_check.programs`."""

from __future__ import annotations

from typing import Final

DEMO: Final = "pam_demo"
RECORDER: Final = "pam_demo.recorder_node"
