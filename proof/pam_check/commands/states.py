"""The command that walks through the states of the suite."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_one_process
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_rig


def _state_walk(given: Arguments) -> Outcome:
    from pam_check.state_walk.walk import run  # noqa: PLC0415

    return run(given)


def _declare(parser: Parser) -> None:
    add_rig(parser)
    add_one_process(parser)


COMMANDS = (
    Command(
        "state-walk",
        "visit every state of driver, board and controller and look for a way round a stop",
        _declare,
        _state_walk,
        bad_news="if air can move after a stop or fault without the acts that it needs",
    ),
)
