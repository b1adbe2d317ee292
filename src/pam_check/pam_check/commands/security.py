"""Commands for the SROS 2 policy."""

from __future__ import annotations

from pam_model.argument_types import output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser, add_rig


def _declare_security(parser: Parser) -> None:
    parser.add_argument("file", type=output_file, help="where to write the policy (XML)")
    add_rig(parser)


def _security(given: Arguments) -> Outcome:
    from pam_check.security.policy import run  # noqa: PLC0415

    return run(given)


def _security_check(given: Arguments) -> Outcome:
    from pam_check.security.check_node import run  # noqa: PLC0415  (rclpy)

    return run(given)


COMMANDS = (
    Command(
        "security",
        "write the SROS 2 policy of a rig",
        _declare_security,
        _security,
        examples=("pam check security my_policy.xml --rig my_robot.yaml",),
    ),
    Command(
        "security-check",
        "compare the SROS 2 policy with the topics and services that running nodes use",
        add_rig,
        _security_check,
        bad_news="if they differ",
    ),
)
