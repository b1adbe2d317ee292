"""How far a joint yields to an outside torque, to a load and to a supply that sags.

    python benchmarks/disturbance_bench.py [--json] [--rig FILE] [--seed N]

It is `./pam check disturbances`, which prints a row for the controller with its default parameters,
one without adaptation, and the muscles alone.
"""

from __future__ import annotations

import sys

from pam_check.commands.control import DISTURBANCES
from pam_model.command_line import run_command

if __name__ == "__main__":
    sys.exit(run_command(DISTURBANCES, "python benchmarks/disturbance_bench.py"))
