"""Draws of one delay and one hidden effect: what is judged, and how an interrupted run goes on."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from pam_check.__main__ import main
from pam_check.faults.campaign import in_a_fork
from pam_check.faults.delay_draws import (
    BORNE,
    PLACES,
    STOPS,
    TRACKS,
    DelayDraw,
    by_delay,
    draws,
    judge_draw,
    not_borne,
    read_draws,
    run_draw,
)
from pam_model.effects import EFFECTS
from support.rigs import ELBOW

SEED = 11
UP, DOWN = "frames_delayed_up", "frames_delayed_down"


def test_an_interrupted_run_goes_on_with_the_draws_that_are_missing(tmp_path, capsys, monkeypatch):
    """With draws whose result is their seed; the tests below play some."""
    monkeypatch.setattr("pam_check.faults.delay_draws.make_chain", lambda *_: None)
    monkeypatch.setattr(
        "pam_check.faults.delay_draws.judge_draw",
        lambda _, drawn, seed: replace(drawn, outcome=TRACKS, last_error=1e-12 * seed),
    )
    whole, parts = tmp_path / "whole.csv", tmp_path / "parts.csv"
    command = ["delays", "--rig", str(ELBOW), "--seed", str(SEED), "--jobs", "1"]
    for count, table, more in ((2, whole, []), (1, parts, []), (2, parts, ["--resume"])):
        assert main([*command, "--draws", str(count), "--out", str(table), *more]) == 0
        assert f"{count} draws" in capsys.readouterr().out
    assert parts.read_text() == whole.read_text()
    assert len(read_draws(whole, SEED)) == 2
    assert main([*command[:-3], "12", "--out", str(whole), "--resume"]) == 2
    assert "not the draws of --seed 12" in capsys.readouterr().err
    whole.write_text("place,delay\nhere,there\n")
    assert main([*command, "--out", str(whole), "--resume"]) == 2
    assert "no table of delays" in capsys.readouterr().err


def test_every_effect_meets_every_place_and_delays_are_drawn_from_the_whole_range():
    drawn = [one for one, _ in draws(len(PLACES) * len(EFFECTS), SEED)]
    assert set(Counter((one.place, one.effect) for one in drawn).values()) == {1}
    assert len({(one.place, one.effect) for one in drawn}) == len(drawn)
    assert min(one.delay for one in drawn) < 0.005
    assert max(one.delay for one in drawn) > 0.075


def test_a_short_delay_is_followed_and_a_long_one_stops_the_loop(chain):
    short = in_a_fork(lambda: judge_draw(chain, DelayDraw(UP, 0.004, "creep"), 1))
    assert (short.outcome, short.by, short.alone) == (TRACKS, "", "")
    assert 0.0 < short.last_error <= short.peak_error
    long = in_a_fork(lambda: judge_draw(chain, DelayDraw(DOWN, 0.05, "creep"), 1))
    assert (long.outcome, long.by, long.alone) == (STOPS, "loop_too_slow", "")


def test_a_short_delay_that_is_not_borne_is_tried_without_the_delay(chain):
    drawn = DelayDraw(UP, 0.5 * BORNE, "supply_droop")
    done = in_a_fork(lambda: judge_draw(chain, drawn, 1))
    alone = in_a_fork(lambda: run_draw(chain, replace(drawn, delay=0.0), 1))
    assert (done.outcome, done.alone) == (STOPS, alone.outcome)
    (line,) = not_borne([done, DelayDraw(UP, 0.5 * BORNE, "creep", TRACKS)])
    assert "supply_droop: stops by supply_low; without the delay it stops" in line


def test_the_summary_counts_by_range_of_delay():
    done = [
        DelayDraw(UP, 0.004, "creep", TRACKS),
        DelayDraw(UP, 0.005, "creep", STOPS, by="supply_low"),
        DelayDraw(UP, 0.06, "creep", STOPS, by="loop_too_slow"),
    ]
    lines = by_delay(done)
    assert lines[0] == " 0 to 10 ms: 2 draws, 1 track, 1 stop (supply_low 1)"
    assert lines[3] == "40 to 80 ms: 1 draws, 0 track, 1 stop (loop_too_slow 1)"
