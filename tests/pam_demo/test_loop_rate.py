"""The demo on a slow computer: it takes a rate that is held, says so, and succeeds."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pam_demo import demo
from pam_demo.figures import Figure, Results, explained
from pam_demo.loop_rate import RATES, RateNotHeld, TooSlowError, judge, rate_sentence, trial
from pam_demo.motions import arm_motion
from pam_demo.page import write_page
from pam_demo.player import NotPlayedError
from pam_demo.player_node import LOOPS, PlayerNode

PLAYS = [("full", arm_motion())]


class LoggedChain:
    """Notes with which parameters the nodes are started, and starts nothing."""

    def __init__(self) -> None:
        self.params_files = [Path("rig.yaml")]
        self.environment: dict[str, str] = {}
        self.started: list[tuple[str, dict[str, Any]]] = []
        self.processes: dict[str, Any] = {}
        self.stopped = 0

    def start(self, name: str, parameters: Any = None) -> Any:
        self.started.append((name, dict(parameters or {})))
        return SimpleNamespace(wait_for_output=lambda *_: None)

    def start_robot(self, parameters: dict[str, Any]) -> None:
        for name, values in parameters.items():
            self.start(name, values)

    def stop_all(self) -> None:
        self.stopped += 1

    def check(self) -> None:
        pass


class SlowComputer:
    """A player on a computer that holds rates up to `held` [Hz]; `vents` at a faster one."""

    def __init__(self, chain: LoggedChain, held: float, *, vents: bool = False) -> None:
        self.chain, self.held, self.vents = chain, held, vents
        self.played: list[str] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None  # what waits, vents and activates

    @property
    def rate(self) -> float:
        return next(p["rate"] for n, p in reversed(self.chain.started) if n == "driver")

    def play(self, motion: Any, *_: object) -> float:
        if self.vents and self.rate > self.held:
            raise NotPlayedError("positions are 55 ms old")
        self.played.append(motion.name)
        return 0.0

    def late_share(self) -> float:
        return 0.05 if self.rate > self.held else 0.001


@pytest.fixture(autouse=True)
def no_recorder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pam_demo.demo.NodeProcess", lambda *_, **__: None)


@pytest.mark.parametrize("vents", [False, True])
@pytest.mark.parametrize(("held", "taken"), [(600.0, 500.0), (300.0, 250.0), (10.0, 125.0)])
def test_the_demo_takes_the_highest_rate_that_is_held(held, taken, vents, tmp_path):
    chain = LoggedChain()
    computer = SlowComputer(chain, held, vents=vents and held > 100.0)
    runs, not_held = demo.perform_at_a_rate_that_is_held(chain, computer, tmp_path, PLAYS, {})
    assert [one.rate for one in not_held] == [rate for rate in RATES if rate > taken]
    assert chain.stopped == len(not_held)
    assert [run["rate"] for run in runs] == [taken]
    last = dict(chain.started)
    assert last["driver"]["rate"] == last["controller"]["loop.rate"] == taken
    assert last["rig"]["measurement_rate"] == taken
    assert computer.played[-1] == "arm"
    assert all(run["motion"] != trial().name for run in runs), "the trial is no figure"


def test_a_rate_is_refused_only_if_it_is_not_held_twice(tmp_path):
    """What a computer still does after a first start makes the first trial late."""
    chain = LoggedChain()
    computer = SlowComputer(chain, 1000.0)
    shares = [0.085, 0.001]
    computer.late_share = lambda: shares.pop(0)
    runs, not_held = demo.perform_at_a_rate_that_is_held(chain, computer, tmp_path, PLAYS, {})
    assert not_held == []
    assert [run["rate"] for run in runs] == [RATES[0]]
    assert computer.played == ["trial", "trial", "arm"]


def test_a_motion_that_cannot_be_played_at_the_lowest_rate_is_an_error(tmp_path):
    chain = LoggedChain()
    with pytest.raises(TooSlowError, match="55 ms old"):
        demo.perform_at_a_rate_that_is_held(
            chain, SlowComputer(chain, 1.0, vents=True), tmp_path, PLAYS, {}
        )


def _told(player: PlayerNode, name: str, cycles: int, late: int, skipped: int) -> None:
    counts = {"cycles": cycles, "late cycles": late, "skipped cycles": skipped}
    values = [SimpleNamespace(key=key, value=str(value)) for key, value in counts.items()]
    player._on_diagnostics(
        SimpleNamespace(status=[SimpleNamespace(name=name, values=values, level=0)])
    )


def test_late_cycles_are_counted_from_the_diagnostics_of_both_loops():
    player = PlayerNode.__new__(PlayerNode)
    player._counts = {}
    player.start_counting()
    _told(player, LOOPS[0], 1000, 70, 0)
    _told(player, LOOPS[0], 2000, 71, 1)
    assert player.late_share() == 1.0, "nothing is known of the other one"
    _told(player, LOOPS[1], 500, 0, 0)
    _told(player, LOOPS[1], 1500, 30, 10)
    assert player.late_share() == pytest.approx(0.04)
    judge(0.001)
    with pytest.raises(TooSlowError, match="4 % of the cycles were late"):
        judge(player.late_share())


FIGURES = [
    Figure("arm_rms", "the arm", 0.02, "rad", 0.01),
    Figure("chirp_1hz_rms", "chirp", 0.001, "rad", 0.015),
    Figure("controller_late", "late", 3.0, "%", 1.0),
]


@pytest.mark.parametrize(
    ("figures", "rate", "told"),
    [
        (FIGURES, 500.0, "the loops were late"),
        (FIGURES[:2], 250.0, "at 250 Hz the feedback is slower"),
        (FIGURES[:2], 500.0, "the control itself"),
    ],
)
def test_every_red_tile_has_a_sentence(figures, rate, told, tmp_path):
    results = Results(explained(figures, rate), [], {"/valve_commands": np.full(9, 0.002)}, rate)
    sentence = rate_sentence(rate, [RateNotHeld(500.0, "3 % late")] if rate < 500.0 else [])
    page = write_page(tmp_path / "demo.html", results, "vcan0", {}, sentence).read_text()
    assert sentence in page
    cards = re.findall(r'<div class="card">(.*?)</div>', page, re.DOTALL)
    assert len(cards) == len(figures)
    for card in cards:
        assert ('class="bad"' in card) == ("missed: " in card)
    assert told in cards[0]
    assert [figure["reason"] for figure in results.as_json()["figures"]][1] == ""


@pytest.mark.parametrize(("separate", "told"), [(False, "in one process"), (True, "as separate")])
def test_plots_have_a_form_for_phones_and_the_page_names_the_processes(separate, told, tmp_path):
    results = Results([], [], {"/valve_commands": np.full(9, 0.002)}, 500.0)
    page = write_page(tmp_path / "demo.html", results, "vcan0", {}, "", separate=separate)
    text = page.read_text()
    assert told in text.replace("\n", " ")
    narrow, wide = re.findall(r'base64,([\w+/=]+)"', text)
    assert "max-width: 700px" in text
    widths = [
        float(re.search(r'width="([\d.]+)pt"', base64.b64decode(svg).decode())[1])
        for svg in (narrow, wide)
    ]
    assert widths[0] < 320.0
    assert widths[1] > 700.0
    assert "min-width: 640px" not in text


def test_make_demo_asks_for_no_check():
    makefile = (Path(__file__).parents[2] / "Makefile").read_text()
    assert "\t@./pam demo\n" in makefile


def test_a_rate_that_only_the_trial_kept_is_not_called_held() -> None:
    assert rate_sentence(500.0, []).endswith("at 500 Hz, which this computer holds.")
    late = rate_sentence(500.0, [], late=True)
    assert "held in the trial, but not throughout" in late
