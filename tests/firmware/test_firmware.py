"""The firmware keeps the protocol under the sanitizers, and equals the simulated board.

`make` builds it as a process; without a C compiler these tests are skipped.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pam_check.fuzz.random_targets import frame
from pam_driver.board_rules.conformance import RULES, find_board, play_all
from pam_driver.board_rules.page import as_text
from pam_driver.board_rules.rule import RuleVerdict
from pam_driver.board_rules.tester import BoardTester, TestLimits
from pam_driver.boards.pam_board.codec import BoardCode, BoardCommand, BoardState, ValveCommand
from pam_sim.boards.firmware_twin import FirmwareBoard
from pam_sim.boards.pam_board_twin import SimulatedPamBoard
from pam_sim.boards.protocol import BoardSettings, BoardValve
from support.broken_boards import CODEC, VirtualLine

ROOT = Path(__file__).parents[2]
CORPUS = ROOT / "tests/data/fuzz_corpus/frames.txt"
LIMIT = 2e5  # Pa gauge

pytestmark = pytest.mark.skipif(
    shutil.which("gcc") is None or shutil.which("make") is None, reason="no gcc or make"
)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build with the address and undefined-behaviour sanitizers."""
    out = tmp_path_factory.mktemp("firmware")
    made = subprocess.run(
        ["make", "-C", ROOT / "firmware", f"OUT={out}", f"PYTHON={sys.executable}",
         f"{out}/pam_board_checked"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    return out / "pam_board_checked"


def board_of(program: Path) -> FirmwareBoard:
    valves = (BoardValve(max_pressure=LIMIT), BoardValve(max_pressure=LIMIT))
    return FirmwareBoard(program, 0, BoardSettings(), valves, (0, 1), (0, 1), 0.0)


def test_the_firmware_keeps_every_rule_of_the_protocol(program: Path) -> None:
    board = board_of(program)
    board.misbehave("emergency_stop", 1.0)
    board.misbehave("enabling_switch", 1.0)
    line = VirtualLine(board)  # type: ignore[arg-type]
    tester = BoardTester(line, CODEC, 0, TestLimits(over_pressure=LIMIT, ask=line.person))
    find_board(tester)
    results = play_all(tester, may_open=True)
    line.sim.boards[0].close()  # type: ignore[attr-defined]
    assert [as_text(one) for one in results if one.verdict is not RuleVerdict.PASS] == []
    assert [result.rule for result in results] == list(RULES)


def corpus() -> list[tuple[int, bytes]]:
    """The frames of the kept corpus, as the fuzz target `frames` reads them."""
    found = []
    for line in CORPUS.read_text().splitlines():
        data = bytes.fromhex(line)
        while data:
            word = int.from_bytes(data[:2], "little")
            length = min(word >> 11, 8)
            found.append((word & 0x7FF, data[2 : 2 + length]))
            data = data[2 + length :]
    assert len(found) > 500
    return found


def fuzz_frames(draw: random.Random, count: int) -> list[tuple[int, bytes]]:
    """The kept corpus, random and mutated frames, and valid ones that change the state."""
    found = corpus()
    counter = 0
    while len(found) < count:
        choice = draw.random()
        counter = (counter + draw.choice((0, 1, 1, 1))) & 0xFF
        if choice < 0.4:
            identifier, data = frame(CODEC, draw)
            found.append((identifier, data[:8]))
        elif choice < 0.9:
            enable = draw.choice(((True, True), (True, True), (False, False), (True, False)))
            valves = (draw.uniform(-1.0, 1.0), draw.uniform(-1.0, 1.0))
            bits = (draw.random() < 0.5, draw.random() < 0.5)
            found.append(CODEC.encode(0, ValveCommand(valves, enable, counter, *bits)))
        else:
            found.append(CODEC.encode(0, BoardCommand(draw.choice(list(BoardCode)))))
    return found


def test_firmware_and_simulated_board_agree_on_every_frame_of_the_fuzz_corpus(
    program: Path,
) -> None:
    """Both get the same frames, readings and pauses; a difference in any of them is a mistake."""
    draw = random.Random(7)
    firmware = board_of(program)
    twin = SimulatedPamBoard(0, CODEC, valves=firmware.valves)
    states = set()
    now = 0.0
    for number, (frame_id, data) in enumerate(fuzz_frames(draw, 8000)):
        now += 0.11 if draw.random() < 0.002 else 0.001
        high = draw.random() < 0.001
        pressures = (LIMIT + 1e4 if high else draw.uniform(0.0, 0.9 * LIMIT), 5e4)
        angles = (float("nan") if draw.random() < 0.001 else 0.3,)
        for board in (firmware, twin):
            board.poll(now, pressures, angles, 7e5)
            if frame_id <= 0x7FF:
                board.on_frame(frame_id, data, now)
        sent = [board.poll(now, pressures, angles, 7e5) for board in (firmware, twin)]
        assert firmware.state is twin.state, (number, hex(frame_id), data.hex())
        assert firmware.faults == twin.faults, (number, hex(frame_id), data.hex())
        assert firmware.rejected_frames == twin.rejected_frames, (number, hex(frame_id))
        assert firmware.valve_commands == pytest.approx(twin.valve_commands, abs=1e-4)
        assert firmware.brake_released is twin.brake_released
        assert all(CODEC.decode(*one) for one in sent[0])
        states.add(twin.state)
    firmware.close()
    assert states >= {BoardState.VENTED, BoardState.ACTIVE, BoardState.FAULT}
    assert twin.rejected_frames > 100


def test_constants_of_the_firmware_are_those_of_the_dbc_file() -> None:
    text = (ROOT / "firmware/core/pam_board.c").read_text()
    assert f"WATCHDOG_US {round(1e6 * CODEC.watchdog_timeout)}u" in text
