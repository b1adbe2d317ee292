"""Signals that no working sensor gives, and those that one does."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest

from pam_driver.board_monitor import Sample
from pam_driver.sensor_checks import SensorChecks
from pam_model.rig import Plausibility, Rig

SUPPLY = 701325.0
PERIOD = 0.002


class Signals:
    """Feeds samples of a rig that stands still, but for what a test changes."""

    def __init__(self, rig: Rig) -> None:
        self.checks = SensorChecks(rig)
        self.now = 10.0
        self.worst: dict[str, float] = {}

    def run(self, count: int, pressure=lambda k: 2e5, position=lambda k: 0.1, supply=SUPPLY):
        """Returns the greatest size found, by kind."""
        worst: dict[str, float] = {}
        for k in range(count):
            self.now += PERIOD
            pressures = [Sample(pressure(k), self.now), Sample(2e5, self.now)]
            positions = [Sample(position(k), self.now)]
            for found in self.checks.update(pressures, positions, [supply] * 2, self.now):
                worst[found.kind] = max(worst.get(found.kind, 0.0), found.size)
        return worst


@pytest.fixture
def signals(rig: Rig) -> Signals:
    return Signals(rig)


def test_fast_but_possible_motion_is_no_fault(signals: Signals) -> None:
    draw = random.Random(1)
    assert (
        signals.run(
            2000,
            lambda k: 3e5 + 2.5e5 * math.sin(0.012 * k) + draw.gauss(0.0, 300.0),
            lambda k: 0.9 * math.sin(0.012 * k) + draw.gauss(0.0, 5e-4),
        )
        == {}
    )


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_step_is_seen_at_the_first_sample_and_remembered_for_a_while(
    signals: Signals, sign: float
) -> None:
    signals.run(50)
    assert signals.run(1, pressure=lambda k: 2e5 + sign * 1e5)["pressure_rate"] == pytest.approx(2)
    assert signals.run(100, pressure=lambda k: 2e5 + sign * 1e5)["pressure_rate"] > 1.0
    signals.run(200, pressure=lambda k: 2e5 + sign * 1e5)
    assert "pressure_rate" not in signals.run(10, pressure=lambda k: 2e5 + sign * 1e5)


def test_an_angle_that_jumps(signals: Signals) -> None:
    signals.run(50)
    assert signals.run(1, position=lambda k: 0.35)["position_jump"] == pytest.approx(1.25)


def test_a_change_over_a_gap_is_no_step(signals: Signals) -> None:
    signals.run(50)
    signals.now += 0.09  # the joint may move on while frames are lost
    assert signals.run(1, position=lambda k: 0.3) == {}
    signals.now += 5.0
    assert signals.run(50, position=lambda k: 0.9, pressure=lambda k: 6e5) == {}


@pytest.mark.parametrize(("sigma", "expected"), [(1e3, 0.0), (7e3, 0.7), (3e4, 3.0)])
def test_noise_is_measured(signals: Signals, sigma: float, expected: float) -> None:
    draw = random.Random(2)
    signals.run(400, pressure=lambda k: 2e5 + draw.gauss(0.0, sigma))
    found = signals.run(100, pressure=lambda k: 2e5 + draw.gauss(0.0, sigma))
    assert found.get("sensor_noise", 0.0) == pytest.approx(expected, rel=0.6)


def test_one_wild_sample_is_a_step_but_no_noise(signals: Signals) -> None:
    signals.run(100)
    found = signals.run(60, pressure=lambda k: 9e5 if k == 20 else 2e5)
    assert found["pressure_rate"] > 1.0
    assert found.get("sensor_noise", 0.0) < 1.0


def test_a_vacuum_cannot_be(signals: Signals) -> None:
    assert signals.run(1, pressure=lambda k: -9e3) == {}
    assert signals.run(1, pressure=lambda k: -2.1e4)["sensor_range"] == pytest.approx(1.05)


@pytest.mark.parametrize(("share", "size"), [(1.0, 0.0), (0.7, 0.6), (0.5, 1.0), (0.0, 2.0)])
def test_a_supply_that_sags(signals: Signals, share: float, size: float) -> None:
    found = signals.run(1, supply=101325.0 + share * 6e5)
    assert found.get("supply_low", 0.0) == pytest.approx(size)


def test_an_unknown_supply_is_not_judged(signals: Signals) -> None:
    assert signals.run(5, supply=math.nan) == {}


def test_the_rig_file_sets_the_limits(rig: Rig) -> None:
    wide = Plausibility(position_jump=10.0, pressure_rate=1e9, supply_share=0.0)
    signals = Signals(replace(rig, plausibility=wide))
    signals.run(50)
    found = signals.run(1, lambda k: 4e5, lambda k: 0.9, 301325.0)
    assert set(found) <= {"supply_low", "sensor_noise"}
    assert found["supply_low"] < 1.0


def test_a_missing_value_changes_nothing(signals: Signals) -> None:
    signals.run(50)
    assert signals.run(5, pressure=lambda k: math.nan, position=lambda k: math.nan) == {}
