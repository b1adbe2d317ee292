"""The programs that the demo starts as processes of their own, beside `pam_check.programs`."""

from __future__ import annotations

from typing import Final

DEMO: Final = "pam_demo"
RECORDER: Final = "pam_demo.recorder_node"
