"""A rule of the conformance test, and what came out of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from pam_driver.board_rules.tester import BoardTester


class RuleVerdict(Enum):
    """How a rule came out."""

    PASS = "pass"
    FAIL = "fail"
    NOT_TRIED = "not tried"


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of docs/can_protocol.md and how to test it.

    Attributes
    ----------
    name : str
        Short name, for programs.
    section : str
        The rule in docs/can_protocol.md to which it belongs.
    requirement : str
        What the board must do.
    sent : str
        What the test sends.
    hint : str
        Where to look in the firmware if the rule fails.
    check : callable
        Plays the rule; returns what came back. It raises `RuleBrokenError` or `NotTriedError`.
    opens_valves : bool
        Whether the board becomes active in this test, so that air may move.
    """

    name: str
    section: str
    requirement: str
    sent: str
    hint: str
    check: Callable[[BoardTester], str]
    opens_valves: bool = True


class RuleResult(NamedTuple):
    """The outcome of one rule."""

    rule: Rule
    verdict: RuleVerdict
    came_back: str

    def as_document(self) -> dict[str, str]:
        """The result for --json."""
        rule = self.rule
        return {
            "rule": rule.name,
            "section": rule.section,
            "requirement": rule.requirement,
            "sent": rule.sent,
            "came_back": self.came_back,
            "verdict": self.verdict.value,
            "hint": rule.hint if self.verdict is RuleVerdict.FAIL else "",
        }
