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
    """One rule of docs/can_protocol.md and how to test it."""

    name: str  # short name, for programs
    section: str  # the rule in docs/can_protocol.md to which it belongs
    requirement: str  # what the board must do
    sent: str  # what the test sends
    hint: str  # where to look in the firmware if the rule fails
    # Plays the rule; returns what came back. It raises `RuleBrokenError` or `NotTriedError`.
    check: Callable[[BoardTester], str]
    opens_valves: bool = True  # whether the board becomes active in this test, so that air may move


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
