"""`pam check`: checks of the whole suite, from fault campaigns to blind diagnosis."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys

from pam_check.commands import (
    blind,
    calibration,
    control,
    endurance,
    faults,
    fleet,
    fuzz,
    pages,
    states,
)
from pam_model.command_line import Tool
from pam_ros.program_name import PROGRAM

COMMANDS = (
    *faults.COMMANDS,
    *states.COMMANDS,
    *endurance.COMMANDS,
    *fuzz.COMMANDS,
    *control.COMMANDS,
    *blind.COMMANDS,
    *calibration.COMMANDS,
    *fleet.COMMANDS,
    *pages.COMMANDS,
)


PAGES = f"{PROGRAM} check pages"
TOOL = Tool(
    "check",
    "Checks of the whole suite, on simulated rigs",
    COMMANDS,
    moved=dict.fromkeys(("effects", "rules", "fault-tables"), PAGES),
)

main = TOOL.run


if __name__ == "__main__":
    sys.exit(main())
