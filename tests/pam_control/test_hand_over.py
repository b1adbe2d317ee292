"""What the feedforward takes off the integral, for any errors, learnt torques and resumes."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.pid import hand_over
from pam_control.feedback.stuck_integral import begin_sticking, given_back, keep_handed
from pam_control.loop_guard import GuardAction, LoopGuard
from pam_control.rows.plan_rows import (
    A_FRICTION,
    A_KNOWS,
    A_WEIGHTS,
    N_PLAN,
    Y_GATHERED,
    Y_HANDED,
)
from pam_control.settings import ControlSettings
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import load_rig

CONFIG = Path(__file__).parents[2] / "config"
PERIOD: Final = 0.002
MOST_CARRIED, MOST_LEARNT = 0.5, 0.3  # N m


class NoGuard(LoopGuard):
    """A joint that is not there follows nothing."""

    def judge(self, *_: Any, **__: Any) -> GuardAction:
        return GuardAction.NOTHING


class ToldAdaptation:
    """Learns the torques that a test tells it, as a constant."""

    def __init__(self, row: Any, torques: np.random.Generator) -> None:
        self._row, self._torques = row, torques
        self.delay, self.acts = 0.0, [0.0, 0.0]  # before and after the last step, in the limit

    def update(self) -> None:
        before = float(self._row[A_WEIGHTS])
        if self._torques.random() < 0.3:
            self._row[A_WEIGHTS] = self._torques.uniform(-2.0, 2.0) * MOST_LEARNT
        self._row[A_KNOWS] = 1.0
        now = float(self._row[A_WEIGHTS])
        self.acts = [max(-MOST_LEARNT, min(MOST_LEARNT, each)) for each in (before, now)]

    def restart(self) -> None:
        pass

    def at_rest(self, position: float, limit: float) -> float:
        return 0.0


def carried_and_handed(seed: int, cycles: int, designs: KeptDesigns | None) -> list[list[float]]:
    """Carried by the integral, handed over, and the torque that the last lesson made act."""
    settings = ControlSettings(
        stiffness_grid=(14.0,), integral_limit=MOST_CARRIED, adaptation_limit=MOST_LEARNT
    )
    controller = Controller(load_rig(CONFIG / "elbow.yaml"), settings, designs=designs)
    controller.guard = NoGuard(controller.robot.joints)
    random, (channel,) = np.random.default_rng(seed), controller.channels
    rows = channel.law_state.rows
    told = rows.estimates[0] = _Told(rows.estimates[0], ToldAdaptation(rows.a[0], random))
    found, frequency, rate = [], 1.0, settings.stiffness_rate
    for cycle in range(cycles):
        now, frequency = 1.0 + cycle * PERIOD, frequency + 0.01 * random.standard_normal()
        q = 0.06 * math.sin(2.0 * math.pi * frequency * now)
        told.adaptation.acts = [0.0, 0.0]
        resumed = random.random() < 0.004
        if resumed:
            rate = 1.0 + random.random()
            controller.change(controller.settings.replace(stiffness_rate=rate))
        output = controller.step(now, Measurement([q], [2e5, 2e5], now - 1e-3, now - 1e-3))
        assert output.commands is not None, output.reason
        handed = float(rows.y[0][Y_HANDED])
        before, after = told.adaptation.acts
        found.append([channel.integral - handed, handed, abs(after - before), float(resumed)])
    return found


class _Told:
    def __init__(self, estimates: Any, adaptation: ToldAdaptation) -> None:
        self.adaptation, self.stiffness = adaptation, estimates.stiffness


def judge(found: list[list[float]]) -> None:
    """What holds for any errors, lessons and resumes."""
    carried, handed, acted, resumed = np.array(found).T
    most = MOST_CARRIED
    for k in range(1, len(carried)):
        if resumed[k]:  # goes on with what the joint is held with, and shrinks from there
            most = max(MOST_CARRIED, abs(carried[k]))
            continue
        assert abs(carried[k]) <= most + 1e-9
        assert abs(handed[k]) <= MOST_LEARNT + 1e-9
        assert abs(handed[k] - handed[k - 1]) <= acted[k] + 1e-9
    assert np.abs(carried).max() > 0.99 * MOST_CARRIED  # the limits were reached
    assert np.abs(handed).max() > 0.99 * MOST_LEARNT


@pytest.mark.parametrize("seed", range(4))
def test_integral_and_handed_torque_keep_their_limits_whatever_comes(shared_designs, seed):
    """An integral that turned round after a hand-over reached twice its limit."""
    judge(carried_and_handed(seed, 3000, shared_designs))


@pytest.mark.skipif(not HAVE_NUMBA, reason="needs numba")
def test_plain_python_keeps_the_limits_of_the_hand_over(shared_designs, designs_folder):
    carried_and_handed(0, 1, shared_designs)  # the gains are designed here
    program = (
        "import json, pathlib, sys; from test_hand_over import KeptDesigns, carried_and_handed;"
        "kept = KeptDesigns(pathlib.Path(sys.argv[1]));"
        "json.dump(carried_and_handed(0, 1500, kept), sys.stdout)"
    )
    folder = os.pathsep.join((str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, "-c", program, str(designs_folder)],
        env={**os.environ, "PAM_NO_NUMBA": "1", "PYTHONPATH": folder},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    judge(json.loads(done.stdout))


@pytest.mark.parametrize(
    ("carried", "learnt", "handed", "expected"),
    [(0.5, 0.3, 0.0, 0.3), (0.2, -0.4, 0.1, 0.1), (0.2, 0.7, 0.0, 0.2), (0.5, 0.5, 0.4, 0.6)],
)
def test_the_feedforward_takes_over_what_was_learnt_and_no_more(carried, learnt, handed, expected):
    assert hand_over(carried, learnt, handed, 0.6) == pytest.approx(expected)


class Lesson:
    """Learns the torque that a test sets [N m], and that there is much dry friction."""

    def __init__(self, row: Any, estimates: Any) -> None:
        self._row, self.stiffness = row, estimates.stiffness
        self.adaptation, self.delay, self.torque = self, 0.0, 0.0
        self.update()

    def update(self) -> None:
        self._row[A_WEIGHTS], self._row[A_KNOWS], self._row[A_FRICTION] = self.torque, 1.0, 1.0

    def restart(self) -> None:
        pass

    def forget(self) -> None:
        self.torque = 0.0
        self.update()

    def at_rest(self, position: float, limit: float) -> float:
        return self.torque


class StuckJoint:
    """A joint that sticks by friction 1 mrad before its target."""

    def __init__(self, designs: KeptDesigns | None) -> None:
        settings = ControlSettings(stiffness_grid=(14.0,), adaptation_limit=1.0)
        self.controller = Controller(load_rig(CONFIG / "elbow.yaml"), settings, designs=designs)
        self.controller.guard = NoGuard(self.controller.robot.joints)
        (self._channel,) = self.controller.channels
        rows = self._channel.law_state.rows
        self._y, self._now, self.position = rows.y[0], 1.0, 0.0
        self.lesson = rows.estimates[0] = Lesson(rows.a[0], rows.estimates[0])
        self.run(0.02)
        self.position = -0.001
        self.run(1.0)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            self._now += PERIOD
            stamp = self._now - 1e-3
            measured = Measurement([self.position], [2e5, 2e5], stamp, stamp)
            output = self.controller.step(self._now, measured)
            assert output.commands is not None, output.reason

    @property
    def carried(self) -> float:
        return self._channel.integral - float(self._y[Y_HANDED])

    @property
    def gathered(self) -> float:
        return float(self._y[Y_GATHERED])


def test_what_was_handed_over_while_a_joint_sticks_is_not_given_back_as_well(shared_designs):
    joint = StuckJoint(shared_designs)
    assert joint.gathered == pytest.approx(joint.carried, abs=1e-3)
    assert joint.carried > 0.2
    joint.lesson.torque = 0.15
    joint.run(0.02)
    assert joint.gathered == pytest.approx(joint.carried, abs=1e-3)


@pytest.mark.parametrize("torque", [0.15, -0.15])
def test_an_integral_that_goes_on_with_other_settings_has_gathered_nothing(shared_designs, torque):
    """It goes on with the load that had been learnt, which the next motion needs."""
    joint = StuckJoint(shared_designs)
    joint.lesson.torque = torque
    joint.run(0.02)
    before, carried = joint.gathered, joint.carried
    joint.controller.change(joint.controller.settings.replace(adaptation=False))
    joint.run(0.004)
    assert joint.carried == pytest.approx(carried + torque, abs=0.01)
    assert joint.gathered == pytest.approx(before, abs=0.01)


@pytest.mark.parametrize(
    ("handed", "back"), [(0.05, 0.15), (0.2, 0.0), (0.5, 0.0), (-0.3, 0.2), (0.0, 0.2)]
)
def test_what_was_gathered_is_the_first_to_be_handed_over(handed, back):
    state = [0.0] * N_PLAN
    begin_sticking(state)
    for cycle in range(101):
        given_back(state, (0.3, 0.0, 0.0), 0, 0.297, 0.1 + 0.002 * cycle, 0.5)
    keep_handed(state, handed)
    moving = [(0.3 + 3e-4 * cycle, 0.15, 0.0) for cycle in range(100)]
    assert sum(given_back(state, at, 0, 0.297, 0.3, 0.5) for at in moving) == pytest.approx(
        back, abs=0.01
    )
