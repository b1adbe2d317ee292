"""A host that is killed, and one that comes and goes; how soon is the commands' business."""

from __future__ import annotations

from pam_sim.kill_trials import kill_once
from pam_sim.lifecycle_cycles_node import run_cycles

from .conftest import ELBOW


def test_boards_vent_by_themselves_when_their_host_is_killed(rig):
    vented, _ = kill_once(rig, 0.05)
    assert vented > 0.0


def test_threads_and_handles_come_back_after_each_lifecycle():
    before, after = run_cycles(ELBOW, 12)
    assert after.threads <= before.threads
    assert after.handles <= before.handles
