"""End factors that depend on pressure or contraction, friction that depends on speed."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.muscles.models.tondu_lopez import TonduLopez
from pam_model.muscles.models.tondu_lopez_friction import TonduLopezFriction
from pam_model.muscles.models.tondu_lopez_pressure_factor import TonduLopezPressureFactor
from pam_model.muscles.models.tondu_lopez_two_factors import TonduLopezTwoFactors

MUSCLE = (0.25, 2.0, 0.235)
lengths = st.floats(0.15, 0.249)
pressures = st.floats(0.0, 8e5)


@given(length=lengths, pressure=pressures, k=st.floats(1.0, 1.5))
def test_variants_reduce_to_a_constant_factor(length: float, pressure: float, k: float) -> None:
    plain = TonduLopez(*MUSCLE, k).force(pressure, length)
    constant = TonduLopezPressureFactor(*MUSCLE, falling_factor=0.0, constant_factor=k)
    assert constant.force(pressure, length) == pytest.approx(plain, rel=1e-12, abs=1e-12)
    assert TonduLopezTwoFactors(*MUSCLE, k).force(pressure, length) == pytest.approx(
        plain, rel=1e-12, abs=1e-12
    )
    assert TonduLopezFriction(*MUSCLE, k).force(pressure, length) == plain


@given(
    length=lengths,
    pressure=st.floats(1e3, 8e5),
    falling=st.floats(0.0, 1.0),
    constant=st.floats(1.0, 1.4),
)
def test_pressure_slope_matches_differences(
    length: float, pressure: float, falling: float, constant: float
) -> None:
    muscle = TonduLopezPressureFactor(*MUSCLE, falling_factor=falling, constant_factor=constant)
    low, high = muscle.length_bounds
    length = min(max(length, low + 1e-3), high)
    step = 1.0
    rise = muscle.force(pressure + step, length) - muscle.force(pressure - step, length)
    assert muscle.pressure_slope(pressure, length) == pytest.approx(
        rise / (2.0 * step), rel=1e-5, abs=1e-9
    )


@given(length=st.floats(0.15, 0.234), pressure=st.floats(1e3, 8e5))
def test_free_contraction_grows_with_pressure(length: float, pressure: float) -> None:
    muscle = TonduLopezPressureFactor(*MUSCLE, falling_factor=0.5, constant_factor=1.1)
    assert muscle.force(2.0 * pressure, length) > 2.0 * muscle.force(pressure, length)


def test_factors_at_their_ends() -> None:
    muscle = TonduLopezPressureFactor(*MUSCLE, falling_factor=0.5, constant_factor=1.1)
    assert muscle.factor(0.0) == pytest.approx(1.6)
    assert muscle.factor(8e5) == pytest.approx(1.1, abs=1e-3)
    two = TonduLopezTwoFactors(*MUSCLE, initial_factor=0.1, offset_factor=-0.9)
    assert two.force_factor(0.235) == pytest.approx(1.0)
    assert two.force_factor(0.15) == pytest.approx(0.9, abs=1e-6)


@given(length=lengths, pressure=st.floats(1e3, 8e5), speed=st.floats(1e-6, 10.0))
def test_friction_lies_between_its_two_values(length: float, pressure: float, speed: float) -> None:
    muscle = TonduLopezFriction(*MUSCLE)
    assert 0.015 <= muscle.friction_coefficient(speed) <= 0.105
    assert muscle.friction_coefficient(speed) == muscle.friction_coefficient(-speed)
    loss = muscle.force(pressure, length) - muscle.force(pressure, length, -speed)
    area = muscle.contact_area(length)
    assert loss == pytest.approx(muscle.friction_coefficient(speed) * area * pressure, rel=1e-6)


def test_contact_area_at_rest_is_the_braids() -> None:
    """At rest length, S = 2 pi r0 l0 sin/sin."""
    muscle = TonduLopezFriction(*MUSCLE)
    assert muscle.contact_area(0.235) == pytest.approx(
        2.0 * math.pi * muscle.rest_radius * muscle.rest_length
    )


def test_refusals() -> None:
    muscle = TonduLopezPressureFactor(*MUSCLE, falling_factor=0.5, constant_factor=1.1)
    with pytest.raises(DomainError, match="pressure"):
        muscle.force(-1.0, 0.2)
    with pytest.raises(DomainError, match="constant_factor"):
        TonduLopezPressureFactor(*MUSCLE, falling_factor=0.5, constant_factor=0.0)
    with pytest.raises(DomainError, match=r"54\.74"):
        TonduLopezTwoFactors(0.25, 2.0, 0.1)
