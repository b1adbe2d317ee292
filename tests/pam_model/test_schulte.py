"""Schulte's bladder and friction: limits, signs, the print, and what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.schulte import Schulte

B, N = 0.25, 2.0
D90 = B / (N * math.pi)
lengths = st.floats(0.3 * B, 0.98 * B)
pressures = st.floats(0.0, 8e5)


def muscle(**constants: float) -> Schulte:
    return Schulte(
        B,
        N,
        **{
            "bladder_length": 0.2,
            "bladder_diameter": 0.02,
            "axial_constant": 2e4,
            "hoop_constant": 2e4,
            "friction": 0.03,
            **constants,
        },
    )


@given(length=lengths, pressure=pressures, speed=st.floats(-1.0, 1.0))
def test_without_bladder_and_friction_it_is_the_ideal_braid(
    length: float, pressure: float, speed: float
) -> None:
    bare = muscle(axial_constant=0.0, hoop_constant=0.0, friction=0.0)
    ideal = Gaylord(B, N).force(pressure, length)
    assert bare.force(pressure, length, speed) == pytest.approx(ideal, rel=1e-12, abs=1e-12)


@given(length=lengths, pressure=pressures)
def test_turning_round_flips_the_friction_alone(length: float, pressure: float) -> None:
    model = muscle()
    loss = model.friction(model.contact_pressure(pressure, length), length)
    assert model.force(pressure, length, 0.1) - model.force(pressure, length, -0.1) == (
        pytest.approx(2.0 * loss, abs=1e-9)
    )


@given(length=lengths)
def test_the_bladder_rests_where_it_is_made(length: float) -> None:
    diameter = D90 * math.sqrt(1.0 - (length / B) ** 2)
    model = muscle(bladder_length=length, bladder_diameter=diameter)
    assert model.force(0.0, length) == pytest.approx(0.0, abs=1e-9)


def test_as_printed_the_bladder_pulls_at_rest() -> None:
    """Without a rest length the axial term pulls pi d k_e L at rest diameter and no pressure."""
    diameter = D90 * 0.6
    model = muscle(bladder_length=0.0, bladder_diameter=diameter)
    length = 0.8 * B
    assert model.force(0.0, length) == pytest.approx(math.pi * diameter * 2e4 * length)


@given(length=lengths, pressure=pressures)
def test_contact_needs_more_than_the_bladders_hoop_tension(length: float, pressure: float) -> None:
    model = muscle()
    diameter = D90 * math.sqrt(1.0 - (length / B) ** 2)
    tension = 2.0 * math.pi * 2e4 * (diameter - 0.02) / diameter
    contact = model.contact_pressure(pressure, length)
    assert contact == pytest.approx(max(0.0, pressure - tension), abs=1e-6)


def test_refusals_name_the_constant() -> None:
    with pytest.raises(DomainError, match="hoop_constant"):
        muscle(hoop_constant=-1.0)
    with pytest.raises(DomainError, match="thread length"):
        muscle().force(1e5, B)
