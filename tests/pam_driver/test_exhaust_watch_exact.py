"""When muscles count as empty, what is said while they do not, and how long they may take."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scipy.integrate import quad

from pam_driver.safety.exhaust_watch import ExhaustWatch, exhaust_timeout
from pam_model.rig import Rig
from pam_model.robot import compose

LIMIT, TIMEOUT = 2e4, 1.5
AIR = 287.05  # J/(kg K)
NORMAL_DENSITY = 1.185  # kg/m^3, ISO 8778


@pytest.fixture
def watch(rig: Rig) -> ExhaustWatch:
    return ExhaustWatch(compose(rig), LIMIT, TIMEOUT)


def feed(watch: ExhaustWatch, first: float, second: float, start: float, end: float) -> None:
    """The same readings every 2 ms, up to and with the end."""
    for tick in range(round((end - start) / 0.002) + 1):
        watch.update([first, second], True, start + 0.002 * tick)


def test_before_the_first_reading_nothing_counts_as_empty(watch: ExhaustWatch) -> None:
    assert watch.empty is False and watch.below is False
    assert watch.remaining().count("its pressure is unknown") == 2
    assert "; elbow_extensor: its" in watch.remaining()
    assert list(watch.conditions(1e9)) == []


def test_readings_must_agree_for_twenty_milliseconds(watch: ExhaustWatch) -> None:
    feed(watch, 0.0, 19_999.0, 1.0, 1.018)
    assert watch.below and not watch.empty
    assert watch.remaining() == "below 20000 Pa for less than 20 ms"
    watch.update([0.0, 0.0], True, 1.0 + 0.02)
    assert watch.empty
    assert watch.remaining() == ""


def test_one_reading_at_the_limit_begins_the_time_anew(watch: ExhaustWatch) -> None:
    feed(watch, 0.0, 0.0, 1.0, 1.018)
    watch.update([0.0, LIMIT], True, 1.02)
    assert not watch.below
    assert watch.remaining() == "elbow_extensor: still 20000 Pa"
    feed(watch, 0.0, 0.0, 1.022, 1.04)
    assert not watch.empty
    watch.update([0.0, 0.0], True, 1.043)
    assert watch.empty


def test_an_empty_muscle_is_full_again_above_the_band_or_at_once_when_air_is_let_in(
    watch: ExhaustWatch,
) -> None:
    feed(watch, 0.0, 0.0, 1.0, 1.022)
    feed(watch, 1.249 * LIMIT, 0.0, 2.0, 2.1)
    assert watch.empty and not watch.below
    feed(watch, 1.25 * LIMIT, 0.0, 3.0, 3.018)
    assert watch.empty
    watch.update([1.25 * LIMIT, 0.0], True, 3.021)
    assert not watch.empty
    for pressure, venting in ((1.3 * LIMIT, False), (math.nan, True)):
        feed(watch, 0.0, 0.0, 4.0, 4.03)
        assert watch.empty
        watch.update([pressure, 0.0], venting, 5.0)
        assert not watch.empty


def test_only_a_muscle_that_stays_full_while_all_vent_is_a_fault(watch: ExhaustWatch) -> None:
    watch.update([LIMIT, 0.0], False, 1.0)
    assert list(watch.conditions(9.0)) == []
    feed(watch, LIMIT, 0.0, 2.0, 2.998)
    watch.update([LIMIT, math.nan], True, 3.0)
    assert list(watch.conditions(2.0 + TIMEOUT)) == []
    (found,) = watch.conditions(2.001 + TIMEOUT)
    assert (found.kind, found.subject) == ("exhaust_blocked", "elbow_flexor")
    assert found.text == (
        "still 20000 Pa after 1.5 s of venting, vented_pressure is 20000 Pa: exhaust blocked or "
        "valve stuck; shut the air supply"
    )
    watch.start_again()
    assert list(watch.conditions(9.0)) == []
    watch.update([LIMIT, 0.0], True, 10.0)
    assert list(watch.conditions(10.0 + TIMEOUT)) == []


def test_a_pause_of_the_computer_is_no_time_of_venting(watch: ExhaustWatch) -> None:
    """The valves may have stayed open meanwhile; what was seen before and after it counts."""
    feed(watch, LIMIT, 0.0, 1.0, 1.5)
    feed(watch, LIMIT, 0.0, 4.5, 5.4)
    assert list(watch.conditions(5.4)) == []
    feed(watch, LIMIT, 0.0, 5.402, 5.46)
    (found,) = watch.conditions(5.46)
    assert found.kind == "exhaust_blocked"


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"limits": (-0.2, 0.9)},
        {"limits": (-0.9, 0.2)},
        {"temperature": 330.0, "exponent": 1.3, "ambient": 9e4},
        {"effects": {"exhaust_restriction": {"ratio": 0.4}}},
        {"supply": 4e5},
        {"limits": (-0.2, 0.9), "dead_volume": 5e-5},
        {"limits": (-0.9, 0.2), "dead_volume": 5e-5},
        {"limits": None},
    ],
    ids=["elbow", "one side", "other side", "gas", "exhaust", "supply", "long", "short", "alone"],
)
def test_the_time_limit_is_four_times_the_ideal_time_and_a_second(rig: Rig, change) -> None:
    """By ISO 6358 with the standard density, integrated by another method."""
    limits = change.get("limits", rig.joints[0].position_limits)
    joint = replace(rig.joints[0], position_limits=limits or (0.0, 0.0))
    rig = rig.with_joint(joint) if limits else replace(rig, joints=())
    gas = replace(
        rig.gas,
        temperature=change.get("temperature", rig.gas.temperature),
        polytropic_exponent=change.get("exponent", rig.gas.polytropic_exponent),
        ambient_pressure=change.get("ambient", rig.gas.ambient_pressure),
    )
    rig = replace(rig, gas=gas, supply_pressure=change.get("supply", rig.supply_pressure))
    for muscle in rig.muscles:
        rig = rig.with_muscle(replace(muscle, effects=change.get("effects", {})))
    slower = rig.muscles[0]  # it decides
    more = slower.dead_volume + change.get("dead_volume", 0.0)
    rig = rig.with_muscle(replace(slower, dead_volume=more))
    ratio = change.get("effects", {}).get("exhaust_restriction", {}).get("ratio", 1.0)

    def time_of(index: int) -> float:
        muscle = rig.muscles[index]
        model, sign = rig.force_model(muscle.name), (-1.0, 1.0)[index]
        low, high = joint.position_limits
        volume = muscle.dead_volume + max(
            float(model.volume(muscle.neutral_length + sign * joint.pulley_radius * q))
            for q in (low + k * (high - low) / 8.0 for k in range(9))
        )
        valve, heat = muscle.valve, AIR * gas.temperature
        density = NORMAL_DENSITY * math.sqrt(293.15 / gas.temperature)

        def slowness(inside: float) -> float:
            b, share = valve.critical_ratio, gas.ambient_pressure / inside
            shape = 1.0 if share <= b else math.sqrt(1.0 - ((share - b) / (1.0 - b)) ** 2)
            flow = valve.sonic_conductance * ratio * density * inside * shape
            return volume / (gas.polytropic_exponent * heat * flow)

        begin, end = muscle.max_pressure, LIMIT
        return float(quad(slowness, end + gas.ambient_pressure, begin + gas.ambient_pressure)[0])

    expected = 4.0 * max(time_of(0), time_of(1)) + 1.0
    assert exhaust_timeout(compose(rig), LIMIT) == pytest.approx(expected, rel=1e-3)
