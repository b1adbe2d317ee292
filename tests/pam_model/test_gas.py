"""Flow and chamber: continuity, symmetry, inverses, floats and arrays agree."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model import gas
from pam_model.errors import DomainError

pressures = st.floats(1e5, 1e6)
ratios = st.floats(0.0, 0.9)
C = 4e-9


def test_choked_flow_by_hand() -> None:
    # choked flow is C rho0 p1: 4e-9 m^3/(s Pa) * 1.185 kg/m^3 * 7e5 Pa
    assert gas.mass_flow(C, 0.3, 7e5, 1e5) == pytest.approx(3.318e-3, rel=1e-12)
    assert gas.mass_flow(C, 0.3, 7e5, 1e5, 4 * 293.15) == pytest.approx(1.659e-3, rel=1e-12)


@given(critical=ratios)
def test_flow_function_is_continuous_and_falls(critical: float) -> None:
    psi = gas.flow_function(np.linspace(0.0, 1.0, 4001), critical)
    assert psi[0] == 1.0
    assert psi[-1] == 0.0
    assert np.all(np.diff(psi) <= 1e-12)
    for bend in (critical, gas.LINEAR_RATIO):
        below, above = (
            gas.flow_function(bend - 1e-12, critical),
            gas.flow_function(bend + 1e-12, critical),
        )
        assert below == pytest.approx(above, abs=1e-8)


@given(critical=ratios, first=pressures, second=pressures)
def test_flow_is_odd_under_exchange_of_ports(critical: float, first: float, second: float) -> None:
    there = gas.mass_flow(C, critical, first, second)
    assert gas.mass_flow(C, critical, second, first) == -there
    assert math.copysign(1.0, there) == (1.0 if first >= second else -1.0) or there == 0.0


@given(critical=ratios, first=pressures, second=pressures)
def test_arrays_agree_with_floats(critical: float, first: float, second: float) -> None:
    flow = gas.mass_flow(C, critical, np.array([first, second]), second)
    assert flow.shape == (2,)
    assert flow[0] == pytest.approx(gas.mass_flow(C, critical, first, second), rel=1e-12)
    assert flow[1] == 0.0


def test_vacuum_upstream_gives_no_flow() -> None:
    assert gas.mass_flow(C, 0.3, 0.0, 0.0) == 0.0
    assert gas.mass_flow(C, 0.3, np.zeros(2), 0.0).tolist() == [0.0, 0.0]


@given(opening=st.floats(-1.0, 1.0), pressure=st.floats(1.1e5, 6.9e5), critical=ratios)
def test_opening_is_the_inverse_of_flow(opening: float, pressure: float, critical: float) -> None:
    flow = gas.valve_flow(
        opening,
        pressure,
        supply_pressure=7e5,
        ambient_pressure=1e5,
        conductance=C,
        critical_ratio=critical,
    )
    assert flow * opening >= 0.0
    found = gas.valve_opening(
        flow,
        pressure,
        supply_pressure=7e5,
        ambient_pressure=1e5,
        conductance=C,
        critical_ratio=critical,
    )
    assert found == pytest.approx(opening, abs=1e-9)


@pytest.mark.parametrize(
    ("flow", "pressure", "expected"),
    [(1.0, 3e5, 1.0), (-1.0, 3e5, -1.0), (0.0, 3e5, 0.0), (1e-6, 7e5, 1.0), (-1e-6, 1e5, -1.0)],
)
def test_flow_out_of_reach_opens_fully(flow: float, pressure: float, expected: float) -> None:
    opening = gas.valve_opening(
        flow,
        pressure,
        supply_pressure=7e5,
        ambient_pressure=1e5,
        conductance=C,
        critical_ratio=0.3,
    )
    assert opening == expected


@given(
    rate=st.floats(-1e7, 1e7),
    pressure=pressures,
    volume=st.floats(1e-6, 1e-3),
    volume_rate=st.floats(-1e-3, 1e-3),
    exponent=st.floats(1.0, 1.4),
)
def test_chamber_and_its_inverse(
    rate: float, pressure: float, volume: float, volume_rate: float, exponent: float
) -> None:
    flow = gas.flow_for_pressure_rate(rate, pressure, volume, volume_rate, exponent=exponent)
    back = gas.pressure_rate(flow, pressure, volume, volume_rate, exponent=exponent)
    assert back == pytest.approx(rate, rel=1e-9, abs=1e-3)


def test_shut_chamber_keeps_pressure_times_volume() -> None:
    volume, speed, pressure, step = 1e-4, 1e-5, 3e5, 1e-4
    start = pressure * volume
    for _ in range(10_000):
        half = pressure + 0.5 * step * gas.pressure_rate(0.0, pressure, volume, speed)
        middle = volume + 0.5 * step * speed
        pressure += step * gas.pressure_rate(0.0, half, middle, speed)
        volume += step * speed
    assert pressure * volume == pytest.approx(start, rel=1e-8)


def test_orifice_refuses_backflow_and_takes_arrays() -> None:
    with pytest.raises(DomainError, match="must not be above"):
        gas.orifice_flow(0.8, 1e-6, 1e5, 2e5)
    flow = gas.orifice_flow(0.8, 1e-6, 7e5, np.array([1e5, 3e5, 7e5]))
    assert flow[0] == flow[1] > flow[2] == 0.0
