"""`pam TOOL COMMAND`: the tools and nodes of every installed package of the suite.

A package registers its tool as an entry point of the group `pam.tools`; only the one that the user
names is imported. `python -m <package> COMMAND` does the same.
"""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import os
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points

from pam_model import program_signals
from pam_model.command_line import Tool
from pam_model.linear_algebra_threads import use_one_thread

GROUP = "pam.tools"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the words name, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Words of the command line; those of the process by default.
    """
    if arguments is None:  # the program itself, not a caller within another one
        program_signals.end_at_signals()
        use_one_thread()
    words = list(sys.argv[1:] if arguments is None else arguments)
    found = {entry.name: entry for entry in entry_points(group=GROUP)}
    if words and words[0] in found and "_ARGCOMPLETE" not in os.environ:
        tool: Tool = found[words[0]].load()
        return tool.run(words[1:])
    tools = [entry.load() for _, entry in sorted(found.items())]
    return Tool("", "Drive, simulate and diagnose joints with pneumatic muscles", tools).run(words)


if __name__ == "__main__":
    sys.exit(main())
