"""Hysteresis, creep and phenomenological muscles: memory, passivity, limits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.atlas.losses.bouc_wen import BoucWen
from pam_model.atlas.losses.maxwell_slip import MaxwellSlip
from pam_model.atlas.losses.prandtl_ishlinskii import PrandtlIshlinskii
from pam_model.atlas.losses.standard_linear_solid import StandardLinearSolid
from pam_model.atlas.phenomenological.colbrunn import ColbrunnMuscle
from pam_model.atlas.phenomenological.three_element import ThreeElementMuscle, serres_coefficients
from pam_model.errors import DomainError

STIFFNESSES, SLIPS = (2000.0, 1500.0, 1000.0, 500.0), (5.0, 10.0, 15.0, 20.0)
paths = st.lists(st.floats(-0.1, 0.1), min_size=2, max_size=12)
zetas = st.floats(0.05, 5.0)


@given(outer=st.floats(0.05, 0.1), inner=st.floats(0.0, 0.04))
def test_maxwell_slip_remembers_its_turning_point(outer: float, inner: float) -> None:
    element = MaxwellSlip(STIFFNESSES, SLIPS)
    element.update(-0.2)
    before = element.update(outer)
    element.update(inner)
    assert element.update(outer) == pytest.approx(before, abs=1e-9)


@given(path=paths)
def test_loops_lose_energy(path: list[float]) -> None:
    # Amplitudes at which the trapezoidal rule below is good to 0.3 J.
    closed = [0.04, *(0.3 * x for x in path), 0.04]
    for element in (MaxwellSlip(STIFFNESSES, SLIPS), BoucWen(1.0, 0.7, 0.3)):
        element.update(-0.04)
        position, force, work = 0.04, element.update(0.04), 0.0
        start = force
        for target in [*closed, *closed]:
            for i in range(1, 51):
                x = position + (target - position) * i / 50.0
                following = element.update(x)
                work += 0.5 * (force + following) * (target - position) / 50.0
                force = following
            position = target
        stored = 0.5 * sum(w * w / k for k, w in zip(STIFFNESSES, SLIPS, strict=True))
        available = stored if isinstance(element, MaxwellSlip) else 0.5 * start * start
        assert work >= -(available + 0.3)


@given(path=paths, extra=st.integers(2, 30))
def test_step_size_does_not_matter(path: list[float], extra: int) -> None:
    for make in (
        lambda: MaxwellSlip(STIFFNESSES, SLIPS),
        lambda: PrandtlIshlinskii([0.0, 0.01, 0.03], [1.0, 2.0, 3.0]),
        lambda: BoucWen(1.0, 0.5, -0.2),
    ):
        once, often = make(), make()
        position = 0.0
        for target in path:
            result = once.update(target)
            for i in range(1, extra + 1):
                finely = often.update(position + (target - position) * i / extra)
            position = target
            assert finely == pytest.approx(result, abs=1e-9)


def test_bouc_wen_saturates() -> None:
    element = BoucWen(2.0, 0.7, 0.3)
    assert element.update(100.0) == pytest.approx(2.0)
    assert element.update(-100.0) == pytest.approx(-2.0)
    with pytest.raises(DomainError, match="energy"):
        BoucWen(1.0, 0.1, 0.5)


def test_elements_need_both_lists() -> None:
    with pytest.raises(DomainError, match="1 stiffnesses and 2 slip_forces"):
        MaxwellSlip([1.0], [1.0, 2.0])
    with pytest.raises(DomainError, match="thresholds"):
        PrandtlIshlinskii([], [])


def test_creep_between_its_two_ends() -> None:
    solid = StandardLinearSolid(1e6, 5e5, 1e7)
    assert solid.strain(1e4, 0.0) == pytest.approx(0.01)
    assert solid.strain(1e4, 1e9) == pytest.approx(0.03)
    assert solid.time_constant == 20.0
    with pytest.raises(DomainError, match="time"):
        solid.strain(1e4, -1.0)


@given(zeta=zetas, load=st.floats(0.0, 500.0))
def test_step_response_ends_where_forces_balance(zeta: float, load: float) -> None:
    mass, stiffness = 5.0, 2e4
    damping = 2.0 * zeta * math.sqrt(stiffness * mass)
    muscle = ThreeElementMuscle(mass, damping, stiffness, 900.0)
    final = muscle.final_shortening(load)
    assert muscle.step_response(load, 0.0) == pytest.approx((0.0, 0.0), abs=1e-15)
    slowest = 60.0 * max(zeta, 1.0 / zeta) / muscle.natural_frequency
    assert muscle.step_response(load, slowest)[0] == pytest.approx(final, rel=1e-6)
    times = [slowest * i / 2000.0 for i in range(2001)]
    peak = max(muscle.step_response(load, t)[0] for t in times)
    if zeta >= 1.0:
        assert peak <= final * (1.0 + 1e-9)
    elif zeta < 0.9:
        overshoot = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta * zeta))
        ringing = muscle.natural_frequency * math.sqrt(1.0 - zeta * zeta)
        there = muscle.step_response(load, math.pi / ringing)[0]
        assert there == pytest.approx(final * (1.0 + overshoot), rel=1e-6)


@given(time=st.floats(0.0, 1.0))
def test_branches_of_damping_meet(time: float) -> None:
    critical = 2.0 * math.sqrt(2e4 * 5.0)
    at = ThreeElementMuscle(5.0, critical, 2e4, 900.0).step_response(0.0, time)
    for factor in (1.0 - 1e-5, 1.0 + 1e-5):
        near = ThreeElementMuscle(5.0, factor * critical, 2e4, 900.0).step_response(0.0, time)
        assert near == pytest.approx(at, rel=1e-3, abs=1e-7)


def test_without_damping_it_swings_for_ever() -> None:
    muscle = ThreeElementMuscle(2.0, 0.0, 8e3, 400.0)
    y, _ = muscle.step_response(0.0, 0.3)
    assert y == pytest.approx(0.05 * (1.0 - math.cos(muscle.natural_frequency * 0.3)))


def test_serres_fit() -> None:
    at_550 = serres_coefficients(550e3, contracting=True)
    assert at_550.contractile_force / at_550.stiffness == pytest.approx(61.3e-3, abs=5e-5)
    assert serres_coefficients(400e3, contracting=False).damping < at_550.damping
    with pytest.raises(DomainError, match="150000, 550000"):
        serres_coefficients(100e3, contracting=True)


@given(speed=st.floats(-1.0, 1.0))
def test_colbrunn_friction_takes_power(speed: float) -> None:
    assert ColbrunnMuscle(0.0, 50.0, 10.0).force(0.0, speed) * speed >= 0.0
