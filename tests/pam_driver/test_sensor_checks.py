"""Signals that no working sensor gives, and those that one does."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from pam_driver.boards.protocol import Sample
from pam_driver.safety.pressure_plausibility import Deviation
from pam_driver.safety.sensor_checks import SensorChecks, _noise_of
from pam_model.rig import Plausibility, Rig
from pam_model.robot import compose

SUPPLY = 701325.0
PERIOD = 0.002


class Signals:
    """Feeds samples of a rig that stands still, but for what a test changes."""

    def __init__(self, rig: Rig) -> None:
        self.checks = SensorChecks(compose(rig))
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


def moving(checks: SensorChecks, gaps: list[float], sampled_late: bool, sigma: float) -> float:
    """Greatest noise [rad] told of an angle at 1 rad/s, sampled at uneven times.

    `sampled_late`: it was measured when it came; else evenly, and only came unevenly.
    """
    draw = random.Random(3)
    now, even, worst = 10.0, 0.0, 0.0
    for gap in gaps:
        now += gap
        even += PERIOD
        angle = (now - 10.0 if sampled_late else even) - 0.5 + draw.gauss(0.0, sigma)
        still = [Sample(2e5, now)] * 2
        for found in checks.update(still, [Sample(angle, now)], [SUPPLY] * 2, now):
            if found.kind == "sensor_noise":
                worst = max(worst, float(found.text.split()[1]))
    return worst


@pytest.mark.parametrize("sampled_late", [True, False])
def test_motion_on_a_busy_host_is_no_noise(rig: Rig, sampled_late: bool) -> None:
    """Or a host that pauses and catches up would vent a joint that works."""
    draw = random.Random(5)
    tight = replace(rig, plausibility=replace(rig.plausibility, position_noise=2e-4))
    gaps = [PERIOD * draw.uniform(0.5, 1.5) for _ in range(400)]
    gaps[50::40] = [0.05] * len(gaps[50::40])
    gaps[51::40] = [1e-4] * len(gaps[51::40])
    assert moving(SensorChecks(compose(tight)), gaps, sampled_late, 0.0) == 0.0
    noisy = moving(SensorChecks(compose(tight)), gaps, sampled_late, 0.002)
    assert 0.0005 < noisy < 0.006


def test_noise_is_told_after_a_long_gap_that_another_follows(rig: Rig) -> None:
    """Nothing remembered must not turn into a noise that is no number, above no limit for ever."""
    tight = replace(rig, plausibility=replace(rig.plausibility, position_noise=2e-4))
    gaps = [0.01, 0.11, 0.09] + [PERIOD] * 300
    assert 0.001 < moving(SensorChecks(compose(tight)), gaps, True, 0.002) < 0.006


@pytest.mark.parametrize("stretch", [0.6, 1.0, 1.7])
def test_white_noise_is_told_by_its_deviation_at_any_spacing(stretch: float) -> None:
    """On the mean, and whatever the steady speed."""
    generator = np.random.default_rng(3)
    x = 2.5 * generator.standard_normal((20000, 3)) + 40.0 * np.array([0.0, 1.0, 1.0 + stretch])
    told = [_noise_of(b - a, c - b, stretch) for a, b, c in x.tolist()]
    assert np.mean(told) == pytest.approx(2.5, rel=0.02)


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


# --- to the word and to the limit ---------------------------------------------------------------

EXACT = Plausibility(  # a step of 1e5 Pa or 0.25 rad is a whole one, half of it a warning
    pressure_rate=1e7, position_jump=0.25, pressure_noise=1e9, position_noise=1e9
)
FLEXOR, EXTENSOR = "elbow_flexor", "elbow_extensor"


def look(
    checks: SensorChecks,
    now: float,
    pressures: tuple[float, float] = (2e5, 2e5),
    position: float = 0.0,
    supply: tuple[float, float] = (SUPPLY, SUPPLY),
) -> list[Deviation]:
    samples = [Sample(value, now) for value in pressures]
    return list(checks.update(samples, [Sample(position, now)], supply, now))


@pytest.fixture
def exact(rig: Rig) -> SensorChecks:
    checks = SensorChecks(compose(replace(rig, plausibility=EXACT)))
    for k in range(8):
        assert look(checks, 8.0 + k / 512) == []
    return checks


def test_a_step_is_named_above_its_warning_share(exact: SensorChecks) -> None:
    assert look(exact, 8.015625, (2.5e5, 2e5), 0.125) == []
    assert look(exact, 8.017578125, (2.5e5, 3e5), 0.375) == [
        Deviation("pressure_rate", EXTENSOR, 1.0, "pressure changed at 1e+07 Pa/s"),
        Deviation("position_jump", "elbow", 1.0, "angle jumped by 0.250 rad"),
    ]


def test_a_greater_step_takes_the_place_of_a_smaller_one(exact: SensorChecks) -> None:
    look(exact, 8.015625, (2.75e5, 2e5))
    assert look(exact, 8.017578125, (3.75e5, 2e5))[0].size == 1.0
    assert look(exact, 8.0195312, (3.75e5, 2e5))[0].size == 1.0


def test_a_step_is_forgotten_though_no_sample_comes(exact: SensorChecks) -> None:
    look(exact, 8.015625, (3e5, 2e5))
    old = [Sample(3e5, 8.015625), Sample(2e5, 8.015625)], [Sample(0.0, 8.015625)]
    assert [d.kind for d in exact.update(*old, [SUPPLY] * 2, 8.515625)] == ["pressure_rate"]
    assert list(exact.update(*old, [SUPPLY] * 2, 8.5157)) == []


def test_a_sample_seen_twice_is_no_standstill(exact: SensorChecks) -> None:
    for now in (8.015625, 8.0157, 8.0158):
        old = [Sample(3e5, 8.015625), Sample(2e5, 8.015625)]
        (found,) = exact.update(old, [Sample(0.0, 8.015625)], [SUPPLY] * 2, now)
        assert found.size == 1.0


@pytest.mark.parametrize(("gap", "size"), [(0.005, 2.0), (0.01, 2.0), (0.02, 1.0), (0.0999, 0.0)])
def test_a_change_is_held_against_the_time_it_had(
    gap: float, size: float, exact: SensorChecks
) -> None:
    found = look(exact, 8.0 + 7 / 512 + gap, (4e5, 2e5))
    assert [one.size for one in found] == ([pytest.approx(size)] if size else [])


def alternating(rig: Rig, amplitude: float, count: int, share: float = 1e-9) -> SensorChecks:
    """Checks that have seen a reading go to and fro; all else is wide."""
    wide = Plausibility(pressure_rate=1e9, position_jump=10.0, warning_share=share)
    checks = SensorChecks(compose(replace(rig, plausibility=wide)))
    for k in range(count):
        sign = 1.0 if k % 2 else -1.0
        list(look(checks, 8.0 + k * PERIOD, (2e5 + sign * amplitude, 2e5), sign * 1e-6 * amplitude))
    return checks


def noise(checks: SensorChecks, count: int) -> dict[str, Deviation]:
    """Noise as named after `count` samples, nothing new coming in."""
    now = 8.0 + (count - 1) * PERIOD
    old = [Sample(2e5, now), Sample(2e5, now)]
    found = checks.update(old, [Sample(0.0, now)], [SUPPLY] * 2, now + 1.0)
    return {one.subject: one for one in found if one.kind == "sensor_noise"}


def test_noise_is_that_of_second_differences(rig: Rig) -> None:
    """To and fro by a: the second difference is 4 a, and of sigma it is 0.80 sqrt(6) sigma."""
    found = noise(alternating(rig, 1e4, 1000), 1000)
    sigma = 4e4 / math.sqrt(12.0 / math.pi)
    assert found[FLEXOR].size == pytest.approx(sigma / 10e3, rel=1e-6)
    assert found[FLEXOR].text == f"noise {sigma:.0f} Pa"
    assert found["elbow"].size == pytest.approx(1e-6 * sigma / 0.02, rel=1e-6)
    assert found["elbow"].text == f"noise {1e-6 * sigma:.4f} rad"
    assert EXTENSOR not in found


def test_noise_grows_over_its_memory(rig: Rig) -> None:
    """The first two samples have no second difference; each after it is a 25th of the way."""
    found = noise(alternating(rig, 1e4, 2 + 10), 2 + 10)
    sigma = 4e4 / math.sqrt(12.0 / math.pi) * (1.0 - (24.0 / 25.0) ** 10)
    assert found[FLEXOR].size == pytest.approx(sigma / 10e3, rel=1e-6)


def test_wild_samples_pass_for_noise_slowly(rig: Rig) -> None:
    """At most a tenth of the step that is allowed, and four times the noise so far."""
    allowed = 1e9 * 0.01
    found = noise(alternating(rig, 1e9, 2 + 3), 2 + 3)
    expected = 0.0
    for _ in range(3):
        expected += (4.0 * expected + 0.1 * allowed - expected) / 25.0
    assert found[FLEXOR].size == pytest.approx(expected / 10e3, rel=1e-9)


def test_noise_is_named_above_its_warning_share(rig: Rig) -> None:
    """A noise of nothing over a share of nothing is none."""
    checks = alternating(rig, 0.0, 100, share=0.0)
    assert noise(checks, 100) == {}


def test_a_vacuum_is_named(exact: SensorChecks, rig: Rig) -> None:
    checks = SensorChecks(compose(rig))
    assert look(checks, 8.0, (-1e4, -3e4)) == [
        Deviation("sensor_range", EXTENSOR, 1.5, "-30000 Pa gauge is impossible")
    ]


def test_the_lowest_supply_counts(rig: Rig) -> None:
    ambient = rig.gas.ambient_pressure
    checks = SensorChecks(compose(rig))
    found = look(checks, 8.0, supply=(SUPPLY, ambient + 1.5e5))
    text = f"supply is at {ambient + 1.5e5:.0f} Pa absolute"
    assert found == [Deviation("supply_low", "supply", 1.5, text)]
    assert look(checks, 8.1, supply=(math.nan, ambient + 1.5e5)) == found
    assert look(checks, 8.2, supply=(SUPPLY, ambient + 4.5e5)) == []


@pytest.mark.parametrize(
    ("share", "size"), [(1.0, None), (1.14, None), (1.16, 0.16 / 0.3), (1.3, 1.0), (1.6, 2.0)]
)
def test_a_supply_above_its_limit_is_a_fault_and_half_way_a_suspicion(
    share: float, size: float | None, rig: Rig
) -> None:
    """Flow into a muscle grows with the supply, and with it the gain of the control loop."""
    supply = rig.gas.ambient_pressure + share * rig.supply_gauge_pressure
    found = look(SensorChecks(compose(rig)), 8.0, supply=(SUPPLY, supply))
    expected = [] if size is None else [pytest.approx(size)]
    assert [one.size for one in found] == expected
    kinds = {one[:2] for one in found}
    assert kinds == (set() if size is None else {("supply_high", "supply")})


def test_a_supply_exactly_at_its_warning_share_is_not_named(rig: Rig) -> None:
    """Three quarters and five quarters of the pressure, where a half more or less is a fault."""
    checks = SensorChecks(
        compose(replace(rig, plausibility=Plausibility(supply_share=0.5, supply_high_share=1.5)))
    )
    for share in (0.75, 1.25):
        supply = rig.gas.ambient_pressure + share * rig.supply_gauge_pressure
        assert look(checks, 8.0, supply=(supply, supply)) == []
    for share in (0.74, 1.26):
        supply = rig.gas.ambient_pressure + share * rig.supply_gauge_pressure
        assert len(look(checks, 8.0, supply=(supply, supply))) == 1


@pytest.mark.parametrize(("above", "size"), [(0.0, None), (1e5, None), (-1.0, math.inf)])
def test_no_loss_of_supply_at_all_may_be_asked_for(
    above: float, size: float | None, rig: Rig
) -> None:
    strict = replace(rig, plausibility=Plausibility(supply_share=1.0, supply_high_share=9.0))
    supply = rig.supply_pressure + above
    found = look(SensorChecks(compose(strict)), 8.0, supply=(supply, supply))
    assert [one.size for one in found] == ([] if size is None else [size])


@pytest.mark.parametrize("missing", ["pressure", "position"])
def test_samples_that_do_not_fit_the_rig_are_a_mistake(missing: str, rig: Rig) -> None:
    one, both = [Sample(0.0, 8.0)], [Sample(0.0, 8.0)] * 2
    samples = (one, one) if missing == "pressure" else (both, [])
    with pytest.raises(ValueError, match="shorter"):
        list(SensorChecks(compose(rig)).update(*samples, [SUPPLY] * 2, 8.0))
