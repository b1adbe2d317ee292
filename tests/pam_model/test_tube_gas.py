"""Gas in a muscle behind a tube: mass is kept, pressures become equal, a finer solver agrees."""

from __future__ import annotations

import pytest
from scipy.integrate import solve_ivp

from pam_model.gas import GAS_CONSTANT, reference_density, reference_flow
from pam_model.rig import Gas
from pam_model.robot import RobotValve, Tube
from pam_model.views.tube_gas import LARGEST_CHANGE, LONGEST_STEP, LOWEST, TubeGas

GAS = Gas()
VALVE = RobotValve("flow", 2e-9, 1.0, 0.3, 0.005, 1.0, 0.0, None, None)
CONDUCTANCE, TUBE, MUSCLE = 1e-9, 6e-6, 1.5e-4
PERIOD = 0.002
SUPPLY = 7e5


def nothing(pressure: float) -> float:
    return 0.0


def filling(pressure: float) -> float:
    density = reference_density(GAS.temperature)
    return float(
        density * reference_flow(VALVE.sonic_conductance, VALVE.critical_ratio, SUPPLY, pressure)
    )


def made(**changes: float) -> TubeGas:
    numbers = {"conductance": CONDUCTANCE, "volume": TUBE} | changes
    return TubeGas(Tube(numbers["conductance"], numbers["volume"]), VALVE, GAS, PERIOD)


def test_a_closed_valve_keeps_the_mass_and_makes_the_pressures_equal() -> None:
    gas, at_valve = made(), 6e5
    inside = 2e5
    before = at_valve * TUBE + inside * MUSCLE  # isothermal: in proportion to the mass
    for _ in range(500):
        at_valve, inside = gas.advance(at_valve, inside, nothing, nothing, MUSCLE, 0.0)
        assert at_valve >= inside - 1e-6, "no flow against the pressure"
    assert at_valve * TUBE + inside * MUSCLE == pytest.approx(before, rel=1e-9)
    assert at_valve == pytest.approx(inside, rel=1e-6)


def test_filling_and_leaking_while_the_muscle_grows_agree_with_a_fine_solver() -> None:
    growth, leak = 2e-4, 4e-5  # m^3/s, kg/s
    density, heat = reference_density(GAS.temperature), GAS_CONSTANT * GAS.temperature

    def rates(time: float, state: list[float]) -> list[float]:
        at_valve, inside = state
        through = density * reference_flow(CONDUCTANCE, VALVE.critical_ratio, at_valve, inside)
        volume = MUSCLE + growth * time
        return [
            heat * (filling(at_valve) - through) / TUBE,
            (heat * (through - leak) - inside * growth) / volume,
        ]

    begin = [1.2e5, 1.1e5]
    exact = solve_ivp(rates, (0.0, 0.3), begin, rtol=1e-8, atol=1.0, max_step=1e-4).y[:, -1]
    gas, at_valve = made(), begin[0]
    inside = begin[1]
    for step in range(150):
        volume = MUSCLE + growth * PERIOD * step
        at_valve, inside = gas.advance(
            at_valve, inside, filling, lambda pressure: leak, volume, growth
        )
    assert inside == pytest.approx(exact[1], rel=0.01)
    assert at_valve == pytest.approx(exact[0], rel=0.02)
    assert at_valve > inside + 5e4, "the sensor shows more than the muscle has"


def test_a_tube_without_volume_is_stable() -> None:
    """It is stiffer than the steps allow; it counts as the smallest volume that they bear."""
    gas, at_valve = made(volume=0.0), 1.1e5
    inside, highest = 1.1e5, 0.0
    for _ in range(1000):
        at_valve, inside = gas.advance(at_valve, inside, filling, nothing, MUSCLE, 0.0)
        highest = max(highest, at_valve)
    assert highest <= 1.02 * SUPPLY
    assert inside == pytest.approx(SUPPLY, rel=0.02)


def test_pressures_never_fall_below_what_is_left_of_a_vacuum() -> None:
    gas, at_valve = made(), 1.2e5
    inside = 1.2e5
    for _ in range(200):
        at_valve, inside = gas.advance(
            at_valve, inside, lambda p: -1e-2, lambda p: 1e-2, MUSCLE, 0.0
        )
    assert at_valve == LOWEST
    assert inside == pytest.approx(LOWEST, rel=0.1)


def test_near_its_equilibrium_a_wide_tube_reaches_it_in_one_step_and_keeps_the_mass() -> None:
    """More gas than that would swing between the chambers."""
    gas, at_valve = TubeGas(Tube(1e-6, 2e-3), VALVE, GAS, LONGEST_STEP), 5.01e5
    inside = 5.00e5
    mean = (5.01e5 * 2e-3 + 5.00e5 * 1e-3) / 3e-3
    for _ in range(3):
        at_valve, inside = gas.advance(at_valve, inside, nothing, nothing, 1e-3, 0.0)
        assert at_valve == pytest.approx(mean, rel=1e-9)
        assert inside == pytest.approx(mean, rel=1e-9)


@pytest.mark.parametrize(("temperature", "exponent"), [(330.0, 1.0), (293.15, 1.3)])
def test_both_chambers_follow_the_temperature_and_the_exponent(
    temperature: float, exponent: float
) -> None:
    other = Gas(temperature=temperature, polytropic_exponent=exponent)
    gas = TubeGas(Tube(CONDUCTANCE, TUBE), VALVE, other, LONGEST_STEP)
    inside, flow = 3e5, 1e-4
    heat = exponent * GAS_CONSTANT * temperature
    filled = 3.5e5 + LONGEST_STEP * heat * flow / TUBE
    through = reference_density(temperature) * reference_flow(
        CONDUCTANCE, VALVE.critical_ratio, filled, 3e5
    )
    at_valve, inside = gas.advance(3.5e5, inside, lambda pressure: flow, nothing, MUSCLE, 0.0)
    assert at_valve == pytest.approx(filled - LONGEST_STEP * heat * through / TUBE, rel=1e-9)
    assert inside == pytest.approx(3e5 + LONGEST_STEP * heat * through / MUSCLE, rel=1e-9)


def test_the_smallest_volume_changes_by_a_tenth_of_the_supply_in_a_step() -> None:
    choked = reference_density(GAS.temperature) * VALVE.sonic_conductance * SUPPLY
    narrow = TubeGas(Tube(1e-15, 0.0), VALVE, GAS, LONGEST_STEP)
    inside = 1e5
    after, _ = narrow.advance(1e5, inside, lambda pressure: choked, nothing, MUSCLE, 0.0)
    assert after - 1e5 == pytest.approx(LARGEST_CHANGE * SUPPLY, rel=1e-3)
