"""`python -m pam_gap COMMAND`: diagnose, blind, effects, close-loop, monitor."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from pam_model.errors import PamError


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; a user's mistake ends in one line on standard error."""
    from pam_gap import diagnose  # noqa: PLC0415  (a command loads what it needs)

    parser = argparse.ArgumentParser(prog="python -m pam_gap", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    diagnose.add_arguments(
        commands.add_parser("diagnose", help="find what a rig does beside its rig file")
    )
    given = list(sys.argv[1:] if argv is None else argv)
    command = next((word for word in given if not word.startswith("-")), "")
    blind_parser = commands.add_parser("blind", help="diagnose rigs whose effect is withheld")
    loop_parser = commands.add_parser(
        "close-loop", help="hide an effect, diagnose the demo's recording, run the demo again"
    )
    effects_parser = commands.add_parser("effects", help="write the page of effects")
    commands.add_parser("monitor", help="watch live topics (a ROS node)", add_help=False)
    try:
        if command == "blind":
            from pam_check.blind import campaign  # noqa: PLC0415

            campaign.add_arguments(blind_parser)
            return campaign.main(parser.parse_args(given))
        if command == "effects":
            from pam_gap.answer import effect_pages  # noqa: PLC0415

            effect_pages.add_arguments(effects_parser)
            return effect_pages.main(parser.parse_args(given))
        if command == "close-loop":
            from pam_demo import close_loop  # noqa: PLC0415

            close_loop.add_arguments(loop_parser)
            return close_loop.main(parser.parse_args(given))
        if command == "monitor":
            from pam_gap.live import monitor_node  # noqa: PLC0415

            return int(monitor_node.main(given[given.index("monitor") + 1 :]) or 0)
        return diagnose.run(parser.parse_args(given))
    except PamError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
