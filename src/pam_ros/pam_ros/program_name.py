"""What a user types to run the suite: `pam`, or `./pam` in a source tree with its own `.venv`."""

import sys
from pathlib import Path
from typing import Final

PROGRAM: Final = "./pam" if (Path(sys.prefix).parent / "pam").is_file() else "pam"
"""First word of every command line that a message names."""
