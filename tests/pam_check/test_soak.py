"""A short soak, and that it finds what grows, drifts or is missing."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from pam_check.__main__ import main
from pam_check.endurance import soak
from pam_check.endurance.process_use import Use, use_of
from pam_model.errors import PamError


@pytest.fixture(scope="module")
def shown(rig) -> soak.SoakResult:
    return soak.soak(soak.widened(rig, 1), 6.0)


def test_a_soak_of_one_joint_is_within_bounds(shown):
    assert shown.problems() == []
    assert shown.seconds == pytest.approx(6.0)
    assert shown.heartbeats == 60
    assert shown.worst_error < 0.1


def test_sixteen_muscles_come_up_on_eight_boards(rig):
    wide = soak.widened(rig, 8)
    assert (len(wide.muscles), len({muscle.board for muscle in wide.muscles})) == (16, 8)
    assert soak.soak(wide, 1.0).problems() == []


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda r: {"after": r.after._replace(memory=r.before.memory * 2)}, "memory grows"),
        (lambda r: {"after": r.after._replace(handles=99)}, "file handles grow"),
        (lambda r: {"after": r.after._replace(threads=99)}, "threads grow"),
        (lambda r: {"stamps": soak.Lag(0.0, 0.0, 0.001)}, "stamps drift"),
        (lambda r: {"times": soak.Lag(0.0, -0.001, 0.0)}, "stamps drift"),
        (lambda r: {"times": soak.Lag()}, "stamps drift"),
        (lambda r: {"missed_heartbeats": 1}, "heartbeats missed"),
        (lambda r: {"heartbeats": 0}, "no heartbeat received"),
        (lambda r: {"refused": 1}, "commands refused"),
        (lambda r: {"frames_lost": 1}, "measurements lost"),
        (lambda r: {"worst_error": float("nan")}, "the joints do not follow"),
        (lambda r: {"stopped": "board 3 is gone"}, "board 3 is gone"),
    ],
)
def test_each_thing_out_of_bounds_is_named(shown, change, problem):
    assert replace(shown, **change(shown)).problems() == [problem]


def test_missing_heartbeats_are_counted(rig, monkeypatch):
    """A board that leaves out every tenth of its heartbeats."""
    deliver = soak.SoakChain._bus

    def bus(self):
        deliver(self)
        waiting = self.can._waiting
        if self._cycles % 500 < 10:
            kept = [m for m in waiting if m.arbitration_id & 0x700 != 0x700]
            waiting.clear()
            waiting.extend(kept)

    monkeypatch.setattr(soak.SoakChain, "_bus", bus)
    result = soak.soak(soak.widened(rig, 1), 6.0)
    assert result.missed_heartbeats == pytest.approx(6, abs=1)
    assert result.problems() == ["heartbeats missed"]


@pytest.mark.sampled("one of the moments between two heartbeats", cases=1)
@pytest.mark.parametrize("seconds", [2.0, 2.02, 2.05, 2.09])
def test_the_end_may_come_at_any_time_between_heartbeats(seconds, rig):
    result = soak.soak(soak.widened(rig, 1), seconds)
    assert (result.heartbeats, result.missed_heartbeats) == (pytest.approx(20, abs=1), 0)


def test_heartbeats_that_stop_before_the_end_are_missed(rig, monkeypatch):
    deliver = soak.SoakChain._bus

    def bus(self):
        deliver(self)
        if self.now > 3.95:
            waiting = self.can._waiting
            kept = [m for m in waiting if m.arbitration_id & 0x700 != 0x700]
            waiting.clear()
            waiting.extend(kept)

    monkeypatch.setattr(soak.SoakChain, "_bus", bus)
    result = soak.soak(soak.widened(rig, 1), 2.75)  # from 1.5 s on
    assert result.missed_heartbeats == pytest.approx(3, abs=1)


def test_a_fault_ends_it(rig, monkeypatch):
    step = soak.SoakChain.step

    def spoiled(self):
        if self.now > 5.0:
            self.sim.faults.frozen[0] = math.inf
        step(self)

    monkeypatch.setattr(soak.SoakChain, "step", spoiled)
    result = soak.soak(soak.widened(rig, 1), 20.0)
    assert result.stopped.startswith("after ")
    assert result.seconds < 5.0
    assert result.problems()


def test_an_interruption_ends_it_with_what_was_seen(rig, monkeypatch):
    step = soak.SoakChain.step
    before = signal.getsignal(signal.SIGINT)

    def interrupted(self):
        if self._cycles == 2500:
            os.kill(os.getpid(), signal.SIGINT)
        step(self)

    monkeypatch.setattr(soak.SoakChain, "step", interrupted)
    result = soak.soak(soak.widened(rig, 1), 20.0)
    assert result.problems() == ["interrupted after 4 s"]
    assert result.heartbeats > 30
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("joints", [0, 17])
def test_more_joints_than_boards_are_refused(rig, joints):
    with pytest.raises(PamError, match="expected 1 to 16"):
        soak.widened(rig, joints)


@pytest.mark.parametrize(
    "arguments", [["--hours", "0"], ["--hours", "nan"], ["--joints", "99"], ["--rig", "nowhere"]]
)
def test_a_user_s_mistake_is_named(arguments, capsys):
    assert main(["soak", *arguments]) == 2
    assert "expected" in (text := capsys.readouterr().err) or "nowhere" in text


def test_what_this_process_holds():
    use = use_of()
    assert isinstance(use, Use)
    with open("/dev/null") as _:  # noqa: PTH123
        assert use_of().handles == use.handles + 1
    assert use_of().handles == use.handles
    assert use.memory > 2**20 and use.threads >= 1


def test_a_process_that_has_ended_is_named():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)  # not yet taken note of
    with pytest.raises(PamError, match=f"process {ended.pid} has ended"):
        use_of(ended.pid)
    ended.wait()
    with pytest.raises(PamError, match=f"process {ended.pid} has ended"):
        use_of(ended.pid)
