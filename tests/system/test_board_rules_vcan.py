"""The simulated board keeps rules of the protocol with its frames on real SocketCAN.

Board and tester live in the test's process and follow a clock of its own, so that an emulated
processor can run it; the frames go through the kernel. An emulated processor needs minutes for all
rules (`tests/pam_driver/test_board_rules.py` plays them without a kernel), so these are a few.
"""

from __future__ import annotations

import pytest

from pam_demo.chain import BusChoice
from pam_driver.board_rules.conformance import RULES, find_board, leave, play
from pam_driver.board_rules.line import HeardFrame
from pam_driver.board_rules.page import as_text
from pam_driver.board_rules.rule import RuleVerdict
from pam_driver.board_rules.tester import BoardTester, TestLimits
from pam_driver.can_bus.bus import SendOutcome, open_bus
from support.broken_boards import CODEC, GoodBoard, VirtualLine
from support.reruns import EMULATED

pytestmark = [pytest.mark.vcan, pytest.mark.rerun_because(EMULATED)]


PLAYED = ("echo", "wrong_checksum", "arming", "vent", "watchdog_latches")


class KernelLine(VirtualLine):
    """As `VirtualLine`, but every frame goes through the kernel, each end with its own socket."""

    def __init__(self, board: GoodBoard, bus: BusChoice) -> None:
        super().__init__(board)
        self.ports = [open_bus(bus.interface, bus.channel) for _ in range(2)]

    def send(self, frame_id: int, data: bytes) -> bool:
        return self.ports[0].send(frame_id, data, self._now) is SendOutcome.SENT

    def receive(self, until: float) -> list[HeardFrame]:
        heard = []
        tester, board = self.ports
        while self._now < until - 1e-9:
            for frame in board.receive_all(self._now):
                self.sim.on_frame(frame.frame_id, frame.data, self._now)
            self._now = round((self._now + self.STEP) / self.STEP) * self.STEP
            for sent in self.sim.advance(self._now):
                board.send(*sent, self._now)
            for frame in tester.receive_all(self._now):
                heard.append(HeardFrame(self._now, frame.frame_id, frame.data))
        return heard

    def close(self) -> None:
        for port in self.ports:
            port.close()


def test_the_simulated_board_keeps_rules_over_socketcan(bus: BusChoice) -> None:
    rules = [rule for rule in RULES if rule.name in PLAYED]
    assert len(rules) == len(PLAYED)
    line = KernelLine(GoodBoard(), bus)
    try:
        tester = BoardTester(line, CODEC, 0, TestLimits(ask=line.person))
        find_board(tester)
        results = [play(tester, rule, may_open=True) for rule in rules]
        leave(tester)
    finally:
        line.close()
    assert [as_text(one) for one in results if one.verdict is not RuleVerdict.PASS] == []
