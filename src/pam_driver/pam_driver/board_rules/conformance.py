"""`pam driver check-board`: plays the rules of docs/can_protocol.md against a board."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pam_driver.board_rules import air_rules, frame_rules, people_rules, state_rules
from pam_driver.board_rules.line import BusLine
from pam_driver.board_rules.page import as_text, summary, write_page
from pam_driver.board_rules.rule import Rule, RuleResult, RuleVerdict
from pam_driver.board_rules.tester import BoardTester, NotTriedError, RuleBrokenError, TestLimits
from pam_driver.boards.pam_board.codec import BoardCode, BoardCodec
from pam_driver.can_bus.bus import open_bus
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.errors import PamError

RULES: Final[Sequence[Rule]] = (
    *frame_rules.RULES,
    *state_rules.RULES,
    *air_rules.RULES,
    *people_rules.RULES,
)
"""All rules, those that move no air first."""
_LISTEN: Final = 0.5  # s
_LAST_VENTS: Final = 5
_NO_AIR: Final = "you did not allow the board to open its valves (--yes, or answer yes)"


def find_board(tester: BoardTester) -> None:
    """Listen before anything is sent.

    Raises
    ------
    PamError
        If the board is not there, or somebody else commands it.
    """
    tester.wait(_LISTEN)
    if tester.commanded:
        raise PamError(f"another host commands board {tester.number}: end it first (the driver?)")
    if not tester.heard:
        others = ", ".join(map(str, sorted(tester.others)))
        raise PamError(
            f"no frame from board {tester.number} within {_LISTEN:g} s ("
            + (f"there is board {others}" if others else "no board has answered")
            + "): check power, wiring, bitrate and the board's number"
        )


def play(tester: BoardTester, rule: Rule, may_open: bool) -> RuleResult:
    """Play one rule; a second time if this computer was too slow for a fair test.

    Parameters
    ----------
    rule : Rule
        What to test.
    may_open : bool
        Whether the board's valves may open.
    """
    if rule.opens_valves and not may_open:
        return RuleResult(rule, RuleVerdict.NOT_TRIED, _NO_AIR)
    for _ in range(2):
        tester.fair_again()
        try:
            return RuleResult(rule, RuleVerdict.PASS, rule.check(tester))
        except NotTriedError as error:
            return RuleResult(rule, RuleVerdict.NOT_TRIED, str(error))
        except RuleBrokenError as error:
            result = RuleResult(rule, RuleVerdict.FAIL, str(error))
        if not tester.host_stalled and not tester.unsent:
            return result
    text = f"this computer stalled for {1e3 * tester.stalled:.0f} ms"
    if tester.unsent:
        text = f"the bus did not accept {tester.unsent} frames (queue full, or down)"
    text += f"; {result.came_back}"
    return RuleResult(rule, RuleVerdict.NOT_TRIED, text)


def leave(tester: BoardTester) -> None:
    """Vent the board and leave it in vented, whatever has happened."""
    for _ in range(_LAST_VENTS):
        tester.tell(BoardCode.VENT)
        tester.wait(0.005)
    tester.tell(BoardCode.CLEAR_FAULTS)
    tester.tell(BoardCode.VENT)


def play_all(tester: BoardTester, may_open: bool) -> list[RuleResult]:
    """Play all rules and leave the board vented.

    Parameters
    ----------
    tester : BoardTester
        The board.
    may_open : bool
        Whether the board's valves may open.
    """
    results = []
    try:
        with progress(len(RULES), "rules") as bar:
            for done, rule in enumerate(RULES):
                bar.show(done, rule.name)
                results.append(play(tester, rule, may_open))
            bar.show(len(RULES))
    finally:
        with contextlib.suppress(RuleBrokenError):
            leave(tester)
    return results


def run(given: Arguments) -> Outcome:
    """Test the board, print and write the result; the command `pam driver check-board`.

    Raises
    ------
    PamError
        If the bus cannot be used, the board does not answer, or somebody else commands it.
    """
    codec = BoardCodec.from_dbc(given.dbc, with_canopen=given.with_canopen)
    if given.board >= codec.board_count:
        raise PamError(f"--board {given.board}: expected 0 to {codec.board_count - 1}")
    if given.over_pressure is not None and given.over_pressure <= given.max_pressure:
        raise PamError(
            f"--over-pressure {given.over_pressure:g} Pa must be above --max-pressure "
            f"{given.max_pressure:g} Pa, or every filling would reach it"
        )
    options = {} if given.port is None else {"port": given.port}
    port = open_bus(given.interface, given.channel, bitrate=given.bitrate, **options)
    try:
        limits = TestLimits(
            given.opening,
            given.max_pressure,
            given.over_pressure,
            given.tolerance,
            _ask_to_act if given.person else None,
        )
        tester = BoardTester(BusLine(port), codec, given.board, limits)
        find_board(tester)
        may_open = not given.no_air and (given.yes or _allowed(given))
        results = play_all(tester, may_open)
    finally:
        port.close()
    title = f"Board {given.board} on {port.name}, {time.strftime('%Y-%m-%d %H:%M')}"
    page = Path(given.out)
    write_page(page, title, results)
    for result in results:
        print(as_text(result))
    print(f"{summary(results)}; page: {page}")
    failed = [result for result in results if result.verdict is RuleVerdict.FAIL]
    return Outcome(
        {
            "board": given.board,
            "bus": port.name,
            "rules": [result.as_document() for result in results],
            "page": page,
        },
        [f"{result.rule.name}: {result.came_back}" for result in failed],
    )


def _allowed(given: Arguments) -> bool:
    """Ask a person whether the valves may open; no where nobody can answer."""
    print(
        f"The next rules open the valves of board {given.board} and let up to "
        f"{1e-3 * given.max_pressure:.0f} kPa into its muscles: the joint moves.\n"
        "Keep everybody away from the arm, and the hand on the shut-off valve.\n"
        "Open the valves? Type yes: ",
        end="",
        file=sys.stderr,
        flush=True,
    )
    return sys.stdin.readline().strip().lower() == "yes"


def _ask_to_act(text: str) -> bool:
    """Ask a person to do something within the next seconds; they need not type anything."""
    print(f"\n{text}; the test waits for 30 s.", file=sys.stderr, flush=True)
    return True
