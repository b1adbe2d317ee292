"""Hunt's sigmoid, Al-Ibadi's extension factor, Sarosi's exponential."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.muscles.models.al_ibadi import AlIbadi, extension_factor
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.hunt_sigmoid import HuntConstants, HuntSigmoid

MUSCLE = HuntSigmoid(0.25, 2.0, 0.23, 0.1667)


@given(
    contraction=st.floats(0.0, 0.19),
    force=st.floats(-50.0, 400.0),
    direction=st.sampled_from([-1.0, 0.0, 1.0]),
)
@settings(deadline=None)
def test_sigmoids_force_gives_back_its_pressure(
    contraction: float, force: float, direction: float
) -> None:
    length = 0.23 * (1.0 - contraction)
    try:
        pressure = MUSCLE.pressure(force, 1.0 - length / 0.23, direction)
    except DomainError:
        return  # beyond the tangent's pole no pressure belongs to this force
    if abs(pressure) > 1e8:
        return
    assert MUSCLE.force(pressure, length, -0.1 * direction) == pytest.approx(
        force, rel=1e-7, abs=1e-6
    )


@given(length=st.floats(0.185, 0.229), pressure=st.floats(0.0, 8e5))
@settings(deadline=None)
def test_sigmoids_slopes_match_differences(length: float, pressure: float) -> None:
    rise = MUSCLE.force(pressure + 10.0, length) - MUSCLE.force(pressure - 10.0, length)
    assert MUSCLE.pressure_slope(pressure, length) == pytest.approx(rise / 20.0, rel=1e-5)
    assert MUSCLE.pressure_slope(pressure, length) > 0.0


def test_sigmoids_bracket_is_the_one_that_makes_sense() -> None:
    assert MUSCLE.pressure(0.0, 0.0) == pytest.approx(-5.4e3, abs=50.0)
    assert MUSCLE.pressure(0.0, 0.1667) == pytest.approx(624.4e3, abs=200.0)


def test_sigmoid_without_loss_by_force_still_solves() -> None:
    muscle = HuntSigmoid(0.25, 2.0, 0.23, 0.1667, HuntConstants(a4=0.0))
    pressure = muscle.pressure(50.0, 0.1)
    assert muscle.force(pressure, 0.9 * 0.23) == pytest.approx(50.0)


def test_sigmoids_pole_is_refused() -> None:
    with pytest.raises(DomainError, match="tangent"):
        MUSCLE.pressure(0.0, 0.25)
    with pytest.raises(DomainError, match="eps_max"):
        MUSCLE.pressure(600.0, 0.1)
    with pytest.raises(DomainError, match="leaves no contraction"):
        MUSCLE.force(8e5, 0.23)
    with pytest.raises(DomainError, match="rest length"):
        MUSCLE.force(1e5, 0.24)


def test_extension_factor_at_its_ends() -> None:
    assert extension_factor(0.0) == -2.0
    assert extension_factor(1e5) == pytest.approx(-1.60653066)
    assert extension_factor(1e8) == pytest.approx(-1.0)
    assert extension_factor(np.array([0.0, 1e8])) == pytest.approx([-2.0, -1.0])


@given(angle=st.floats(0.98, 1.45), pressure=st.floats(1e3, 8e5))
def test_extensor_stops_short_of_the_ideal(angle: float, pressure: float) -> None:
    rest = 0.1
    muscle = AlIbadi(rest / math.cos(angle), 5.0, rest)
    free = muscle.free_extension(pressure)
    ideal = 1.0 / (math.sqrt(3.0) * math.cos(angle)) - 1.0
    assert 0.5 * ideal < free < ideal
    assert muscle.force(pressure, rest * (1.0 + free)) == pytest.approx(
        0.0, abs=1e-9 * pressure * rest**2
    )
    assert muscle.force(pressure, rest) < 0.0
    braid = Gaylord(rest / math.cos(angle), 5.0)
    assert muscle.force(pressure, rest) == pytest.approx(braid.force(pressure, rest))


@given(length=st.floats(0.06, 0.2), pressure=st.floats(1e3, 8e5))
def test_extensors_pressure_slope_matches_differences(length: float, pressure: float) -> None:
    muscle = AlIbadi(0.25, 5.0, 0.1)
    rise = muscle.force(pressure + 1.0, length) - muscle.force(pressure - 1.0, length)
    assert muscle.pressure_slope(pressure, length) == pytest.approx(rise / 2.0, rel=1e-5, abs=1e-9)


def test_extensor_refuses_suction() -> None:
    with pytest.raises(DomainError, match="pressure"):
        AlIbadi(0.25, 5.0, 0.1).force(-1.0, 0.11)
