"""The check of commissions: its robots are the drawn ones, and it sees what goes wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pam_check.blind.variety import Variety
from pam_check.calibration import commission_campaign
from pam_check.calibration.commission_campaign import (
    Result,
    _apart,
    _both_files,
    _use_of_limits,
    score,
    together,
    true_rig_file,
)
from pam_check.calibration.drawn_rig import (
    EXCHANGES,
    TrueRig,
    draw_true_rig,
    true_numbers,
    written_numbers,
)
from pam_check.calibration.truth_port import TruthPort
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.motion_loop import scale_of
from pam_demo.commission.play import start_up_check, touch
from pam_demo.commission.tracking import reaches
from pam_demo.commission.watch import Limits
from pam_model.rig import Rig, rig_from_parameters

PERIOD = 0.004


@pytest.fixture(scope="module")
def drawn() -> TrueRig:
    return draw_true_rig(np.random.default_rng(3), Variety())


@pytest.fixture(scope="module")
def written(drawn: TrueRig) -> Rig:
    tree = written_numbers(np.random.default_rng(3), drawn.joint, *drawn.muscles)
    guesses = {"inertia": 0.05, "viscous_friction": 0.3, "gravity_torque": 3.0}
    elbow = tree["elbow"]
    assert isinstance(elbow, dict)
    return rig_from_parameters(tree | {"elbow": guesses | elbow})


def test_the_true_rig_file_has_the_true_numbers_and_the_written_limits(
    drawn: TrueRig, written: Rig
) -> None:
    true = true_rig_file(written, drawn)
    tree = true.to_parameters()
    for key, value in true_numbers(drawn.joint, drawn.muscles).items():
        branch: object = tree
        for step in key.split("."):
            assert isinstance(branch, dict)
            branch = branch[step]
        assert branch == pytest.approx(value)
    assert true.joints[0].position_limits == written.joints[0].position_limits
    assert true.muscles[0].max_pressure == written.muscles[0].max_pressure


@pytest.mark.parametrize("exchanged", ["", *EXCHANGES])
def test_each_exchange_is_told_on_a_drawn_robot_and_nothing_else_is(
    drawn: TrueRig, written: Rig, exchanged: str
) -> None:
    port = TruthPort(drawn, exchanged, PERIOD, 60.0, 0)
    findings = touch(port, written) or start_up_check(port, written)
    assert bool(findings) == bool(exchanged)


def test_use_of_limits_is_that_of_the_true_robot(drawn: TrueRig) -> None:
    port = TruthPort(drawn, "", PERIOD, 10.0, 0)
    for _ in range(100):
        port.advance((1.0, -1.0))
    limits = Limits((1e5, 1e5), 6.0, drawn.joint.lower_limit, drawn.joint.upper_limit)
    pressure, speed, contact = _use_of_limits(port, limits)
    assert pressure > 1.0
    assert speed > 0.5
    assert contact
    wide = replace(limits, pressures=(1e6, 1e6), speed=1e3, lower=-9.0, upper=9.0)
    pressure, speed, contact = _use_of_limits(port, wide)
    assert pressure < 1.0
    assert speed < 1.0
    assert not contact


def test_both_files_are_tried_on_the_same_robot_at_the_same_moment(
    drawn: TrueRig, written: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commission_campaign, "TESTS", 1)
    true = true_rig_file(written, drawn)
    port = TruthPort(drawn, "", PERIOD, 60.0, 0)
    scale = scale_of(true, PERIOD)
    done = Commissioned(rig=true, points=reaches(scale.middle, scale.reach, 0.8))
    found, best = _both_files(port, done, true, "")
    assert math.isfinite(together(found))
    assert together(found) == together(best)  # the same numbers, and also the same noise
    assert _apart(found, best) == 0.0
    assert port.seconds == 0.0
    done.rig = None
    ended, again = _both_files(port, done, true, "")
    assert math.isinf(together(ended))
    assert together(again) == together(best)


def test_what_does_not_track_has_to_say_why() -> None:
    good = Result(0, "", "", 200.0, 60.0, 0.7, 0.4, False, 1.2e-3, 1e-3)
    silent = replace(good, after=2e-3)
    ended = replace(good, ended="the valve is stuck", after=math.nan)
    warned = replace(silent, warned="worse than its numbers predict")
    swapped = replace(ended, exchanged="hoses", was_told=True)
    mended = replace(good, exchanged="hoses", was_told=True)
    missed = replace(good, exchanged="hoses")
    fast = replace(good, speed=1.1)
    found = score([good, silent, ended, warned, swapped, mended, missed, fast])
    assert found["track"] == 4
    assert (found["told"], found["silent"], found["warned"]) == (3, 1, 0)
    assert (found["exchanged_told"], found["exchanged"]) == (2, 3)
    assert found["exchanged_track"] == 2
    assert found["within_limits"] == 7
