"""The conformance test of a board: ours passes, and each broken one fails on its rule."""

from __future__ import annotations

import io
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from pam_driver.__main__ import main
from pam_driver.board_rules import conformance
from pam_driver.board_rules.conformance import RULES, find_board, play, play_all
from pam_driver.board_rules.page import as_text, summary, write_page
from pam_driver.board_rules.rule import RuleResult, RuleVerdict
from pam_driver.board_rules.tester import BoardTester, TestLimits
from pam_driver.boards.pam_board.codec import BoardState
from pam_model.errors import PamError
from support import broken_boards as broken
from support.broken_boards import CODEC, GoodBoard, VirtualLine

# by board the rule that names its fault, and rules that it cannot keep either
BROKEN = {
    broken.WatchdogNotLatched: ("watchdog_latches", set()),
    broken.WatchdogLate: ("watchdog_time", set()),
    broken.WatchdogEarly: ("watchdog_time", set()),
    broken.ArmsOnStaleQueue: (
        "arming",
        {"vent_disarms", "clear_needs_arming", "restart", "enabling_switch"},
    ),
    broken.VentKeepsItArmed: ("vent_disarms", {"arming"}),
    broken.IgnoresOneEnableBit: ("enable_bits", set()),
    broken.AcceptsWrongChecksum: ("wrong_checksum", {"checksum_storm"}),
    broken.AcceptsRepeatedCounter: ("repeated_counter", set()),
    broken.CountsRepeatedCounter: ("repeated_counter", set()),
    broken.VentClearsFaults: ("vent_keeps_fault", {"host_fault"}),
    broken.ClearActsInEveryState: ("clear_in_active", set()),
    broken.StaysArmedOverRestart: ("restart", set()),
    broken.CounterFrozen: ("measurement_counter", set()),
    broken.NoHeartbeat: ("heartbeat", set()),
    broken.WrongScale: ("vented_pressure", {"enable_bits", "over_pressure"}),
    broken.SlowMeasurements: ("measurement_period", set()),
    broken.ChannelsExchanged: ("own_channel", {"enable_bits"}),
    broken.IgnoresLatchFault: ("host_fault", set()),
    broken.CountsNothing: ("wrong_length", {"wrong_checksum", "out_of_range", "checksum_storm"}),
    broken.EmergencyStopOnlyTold: ("emergency_stop", set()),
    broken.EnablingSwitchOnlyTold: ("enabling_switch", set()),
    broken.BrakeReleasedByItsBit: ("brake_and_dump", set()),
    broken.NoOverPressure: ("over_pressure", set()),
}


def results_of(board: GoodBoard, may_open: bool = True) -> tuple[list[RuleResult], VirtualLine]:
    line = VirtualLine(board)
    limits = TestLimits(over_pressure=200_000.0, ask=line.person)
    tester = BoardTester(line, CODEC, 0, limits)
    find_board(tester)
    return play_all(tester, may_open), line


@pytest.fixture(scope="module")
def good() -> tuple[list[RuleResult], VirtualLine]:
    return results_of(GoodBoard())


def test_the_simulated_board_keeps_every_rule(good: tuple[list[RuleResult], VirtualLine]) -> None:
    results, line = good
    assert [as_text(one) for one in results if one.verdict is not RuleVerdict.PASS] == []
    assert [result.rule for result in results] == list(RULES)
    line.receive(line.now() + 0.05)
    assert line.sim.boards[0].state is BoardState.VENTED
    assert not line.sim.boards[0].faults


@pytest.mark.sampled("four of the broken boards", cases=4)
@pytest.mark.parametrize("board", BROKEN, ids=lambda board: board.__name__)
def test_a_broken_board_fails_on_its_rule(board: type[GoodBoard]) -> None:
    expected, related = BROKEN[board]
    results, _ = results_of(board())
    failed = {result.rule.name for result in results if result.verdict is RuleVerdict.FAIL}
    assert expected in failed, [as_text(result) for result in results]
    assert failed <= {expected, *related}, [as_text(one) for one in results]


def test_nothing_opens_a_valve_without_permission() -> None:
    results, line = results_of(broken.ArmsOnStaleQueue(), may_open=False)
    tried = {result.rule.name for result in results if result.verdict is not RuleVerdict.NOT_TRIED}
    assert tried == {rule.name for rule in RULES if not rule.opens_valves}
    assert all(result.verdict is not RuleVerdict.FAIL for result in results)
    assert max(line.sim.ground_truth().pressures) < 1e3


@pytest.mark.parametrize(
    ("typed", "may_open"),
    [("yes\n", True), (" YES\n", True), ("no\n", False), ("\n", False), ("", False)],
)
def test_a_person_permits_it_with_a_yes_alone(
    typed: str,
    may_open: bool,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Of the whole command: what is played on a board that answers."""
    played: list[bool] = []
    line = SimpleNamespace(name="can0", close=lambda: None)
    for name, stub in (
        ("open_bus", lambda *_, **__: line),
        ("find_board", lambda _: None),
        ("play_all", lambda _, permitted: played.append(permitted) or []),
    ):
        monkeypatch.setattr(conformance, name, stub)
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    words = ["check-board", "--out", str(tmp_path / "board.md")]
    assert main(words) == 0
    assert main([*words, "--yes"]) == 0
    assert main([*words, "--no-air"]) == 0
    assert played == [may_open, True, False]
    assert capsys.readouterr().err.count("the joint moves") == 1


def test_a_board_that_is_not_there_is_named_with_those_that_are() -> None:
    tester = BoardTester(VirtualLine(GoodBoard()), CODEC, 3)
    with pytest.raises(PamError, match=r"no frame from board 3 .*there is board 0"):
        find_board(tester)


def test_a_bus_with_a_driver_is_left_alone() -> None:
    line = VirtualLine(GoodBoard())
    tester = BoardTester(line, CODEC, 0)
    driver = BoardTester(line, CODEC, 0)
    heard = line.receive

    def with_driver(until: float) -> list[broken.HeardFrame]:
        frame = CODEC.raw_frame(0, broken.ValveCommand, {"Counter": driver.counter})
        return [broken.HeardFrame(line.now(), *frame), *heard(until)]

    line.receive = with_driver  # type: ignore[method-assign]
    with pytest.raises(PamError, match="another host commands board 0"):
        find_board(tester)


def test_a_slow_computer_is_not_the_boards_fault() -> None:
    line = VirtualLine(GoodBoard())
    tester = BoardTester(line, CODEC, 0)
    heard = line.receive

    def stalling(until: float) -> list[broken.HeardFrame]:
        return heard(until + (0.2 if tester.sent_at > line.now() - 0.01 else 0.0))

    line.receive = stalling  # type: ignore[method-assign]
    find_board(tester)
    rule = next(rule for rule in RULES if rule.name == "watchdog_time")
    result = play(tester, rule, may_open=True)
    assert result.verdict is RuleVerdict.NOT_TRIED
    assert "this computer stalled for" in result.came_back


class PausingLine(VirtualLine):
    """A computer that sleeps for 60 ms in every 300 ms; what arrives meanwhile is lost."""

    AWAKE, PAUSE = 0.24, 0.06

    def __init__(self, board: GoodBoard) -> None:
        super().__init__(board)
        self.pauses_at = self.AWAKE

    def receive(self, until: float) -> list[broken.HeardFrame]:
        heard = super().receive(until)
        if self.now() >= self.pauses_at:
            super().receive(self.now() + self.PAUSE)
            self.pauses_at = self.now() + self.AWAKE
        return heard


class TenPercentLate(GoodBoard):
    def __init__(self, now: float = 0.0) -> None:
        super().__init__(now)
        self._periods[broken.Measurement] = 0.0022


class SleepsOnce(GoodBoard):
    """Sends no measurement for 40 ms in each second."""

    def _is_due(self, kind: type, now: float) -> bool:
        due = super()._is_due(kind, now)
        return due and (kind is not broken.Measurement or now % 1.0 > 0.04)


@pytest.mark.parametrize(
    ("board", "line", "verdict"),
    [
        (GoodBoard, PausingLine, RuleVerdict.PASS),
        (TenPercentLate, PausingLine, RuleVerdict.FAIL),
        (TenPercentLate, VirtualLine, RuleVerdict.FAIL),
        (SleepsOnce, VirtualLine, RuleVerdict.FAIL),
    ],
)
def test_pauses_of_the_computer_fail_no_period_and_hide_no_late_board(
    board: type[GoodBoard], line: type[VirtualLine], verdict: RuleVerdict
) -> None:
    tester = BoardTester(line(board()), CODEC, 0)
    find_board(tester)
    rule = next(rule for rule in RULES if rule.name == "measurement_period")
    result = play(tester, rule, may_open=True)
    assert result.verdict is verdict, result.came_back


def test_without_person_or_limit_the_rules_that_need_them_are_not_tried() -> None:
    tester = BoardTester(VirtualLine(GoodBoard()), CODEC, 0)
    find_board(tester)
    for name in ("over_pressure", "restart", "emergency_stop"):
        result = play(tester, next(rule for rule in RULES if rule.name == name), may_open=True)
        assert result.verdict is RuleVerdict.NOT_TRIED
        assert "--" in result.came_back


@pytest.mark.parametrize("suffix", [".html", ".md"])
def test_the_page_tells_a_firmware_author_what_to_do(
    suffix: str, good: tuple[list[RuleResult], VirtualLine], tmp_path: Path
) -> None:
    rule = RULES[0]
    results = [*good[0], RuleResult(rule, RuleVerdict.FAIL, "0 frames | in 2 s")]
    page = tmp_path / f"board{suffix}"
    write_page(page, "Board 0 on can0", results)
    text = page.read_text()
    assert summary(results) in text
    for part in ("0 frames", rule.hint[:20], rule.requirement[:20], rule.sent[:10]):
        assert part in text
    if suffix == ".md":
        rows = [line for line in text.splitlines() if line.startswith("| ")]
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {6}


def test_every_rule_is_in_the_documented_protocol() -> None:
    """A rule names the section of docs/can_protocol.md, and every numbered rule there is tested."""
    page = (Path(__file__).parents[2] / "docs/can_protocol.md").read_text()
    named = {int(number) for rule in RULES for number in re.findall(r"\b\d+", rule.section)}
    numbered = {int(number) for number in re.findall(r"^(\d+)\. \*\*", page, re.MULTILINE)}
    assert named == numbered
