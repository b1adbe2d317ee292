"""Filling, tubes, heat and bandwidth."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from pam_model import gas
from pam_model.atlas.supply.bandwidth import SupplyLine
from pam_model.atlas.supply.fill_time import exhaust_time, fill_time
from pam_model.atlas.supply.thermal_chamber import ThermalChamber
from pam_model.atlas.supply.tube import StraightTube, series_conductance
from pam_model.errors import DomainError
from pam_model.muscles.models.gaylord import Gaylord

BETWEEN = {"supply_pressure": 7e5, "ambient_pressure": 1e5}


@given(critical=st.floats(0.0, 0.8), end=st.floats(1.1e5, 6.9e5))
def test_times_are_the_integral_of_the_flow(critical: float, end: float) -> None:
    volume, conductance = 1e-4, 1e-8
    scale = volume / (gas.GAS_CONSTANT * 293.15)

    def filling(p: float) -> float:
        return scale / float(gas.mass_flow(conductance, critical, 7e5, p, 293.15))

    def emptying(p: float) -> float:
        return scale / float(gas.mass_flow(conductance, critical, p, 1e5, 293.15))

    bend = min(max(7e5 * critical, 1e5), end)
    expected = quad(filling, 1e5, bend)[0] + quad(filling, bend, end)[0]
    found = fill_time(
        volume, conductance, critical, supply_pressure=7e5, start_pressure=1e5, end_pressure=end
    )
    assert found == pytest.approx(expected, rel=1e-6)
    bend = min(max(1e5 / max(critical, 1e-9), end), 7e5)
    expected = quad(emptying, end, bend)[0] + quad(emptying, bend, 7e5)[0]
    found = exhaust_time(
        volume, conductance, critical, ambient_pressure=1e5, start_pressure=7e5, end_pressure=end
    )
    assert found == pytest.approx(expected, rel=1e-6)


def test_bandwidth_is_one_over_volume() -> None:
    whole = SupplyLine(1e-4, 1e-8)
    fifth = SupplyLine(1e-4, 1e-8, filler_volume=0.8e-4)
    span = {**BETWEEN, "low_pressure": 1.5e5, "high_pressure": 4e5}
    ratio = fifth.cycle_bandwidth(**span) / whole.cycle_bandwidth(**span)
    assert ratio == pytest.approx(5.0, rel=1e-12)
    tubed = SupplyLine(1e-4, 1e-8, tube=StraightTube(2.0, 0.004))
    assert tubed.cycle_bandwidth(**span) < whole.cycle_bandwidth(**span)
    with pytest.raises(DomainError, match="leaves no gas"):
        SupplyLine(1e-4, 1e-8, filler_volume=1e-4)


def test_tube() -> None:
    tube = StraightTube(1.0, 0.004)
    assert tube.delay == pytest.approx(2.9e-3, abs=5e-5)
    assert tube.laminar_flow(2e5, 2.1e5) == pytest.approx(-tube.laminar_flow(2.1e5, 2e5))
    assert 0.0 < tube.attenuation(3e5) < 1.0
    assert series_conductance([1e-8, 1e-8]) == pytest.approx(1e-8 * 2.0 ** (-1.0 / 3.0))
    assert 0.0 < tube.critical_ratio < 1.0
    with pytest.raises(DomainError, match="diameter"):
        StraightTube(1.0, 0.0)


@given(rate=st.floats(-1e-3, 1e-3), pressure=st.floats(1e5, 8e5))
def test_shut_chamber_without_heat_is_adiabatic(rate: float, pressure: float) -> None:
    chamber = ThermalChamber(0.0, 0.0, 293.15)
    found, warming = chamber.rates(
        pressure,
        293.15,
        volume=1e-4,
        volume_rate=rate,
        inflow=0.0,
        inflow_temperature=293.15,
        outflow=0.0,
    )
    assert found == pytest.approx(-1.4 * pressure * rate / 1e-4, rel=1e-12)
    assert warming == pytest.approx(-0.4 * 293.15 * rate / 1e-4, rel=1e-9, abs=1e-12)


def test_closed_cycle_of_muscle_and_chamber_creates_no_energy() -> None:
    """One lossless turn: the gas' work on the muscle is the muscle's work on its load."""
    muscle, ambient, dead = Gaylord(0.25, 2.0), 1e5, 2e-5

    def length(t: float) -> float:
        return 0.2 + 0.02 * math.cos(t)

    def rates(t: float, state: np.ndarray) -> list[float]:
        speed = -0.02 * math.sin(t)
        slope = muscle.volume_slope(length(t))
        pressure_rate = gas.pressure_rate(
            0.0,
            state[0],
            muscle.volume(length(t)) + dead,
            slope * speed,
            temperature=293.15,
            exponent=1.2,
        )
        force = muscle.force(state[0] - ambient, length(t))
        return [pressure_rate, (state[0] - ambient) * slope * speed, -force * speed]

    turn = solve_ivp(rates, (0.0, 2.0 * math.pi), [4e5, 0.0, 0.0], rtol=1e-10, atol=1e-9)
    pressure, gas_work, muscle_work = turn.y[:, -1]
    assert pressure == pytest.approx(4e5, rel=1e-7)
    assert gas_work == pytest.approx(muscle_work, abs=1e-9)
    assert muscle_work == pytest.approx(0.0, abs=1e-6)
    assert np.max(np.abs(turn.y[2])) > 1.0
