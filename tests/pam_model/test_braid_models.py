"""Braid models: limits that need no table of numbers, virtual work, and what they refuse."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import DomainError, RigError
from pam_model.muscles import braid
from pam_model.muscles.force_model import (
    AffineForceModel,
    MuscleGeometry,
    create_force_model,
    registered_models,
)
from pam_model.muscles.models.chou_hannaford import ChouHannaford, ChouHannafordIncompressible
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.tondu_lopez import TonduLopez

B, N, REST, WALL = 0.2758, 1.856, 0.24996, 0.0015
MODELS: dict[str, Any] = {
    "gaylord": Gaylord(B, N),
    "chou_hannaford": ChouHannaford(B, N, WALL),
    "chou_hannaford_thin": ChouHannaford(B, N),
    "chou_hannaford_incompressible": ChouHannafordIncompressible(B, N, REST, WALL),
    "tondu_lopez": TonduLopez(B, N, REST, 1.2),
}
VIRTUAL_WORK = [name for name in MODELS if name != "tondu_lopez"]
lengths = st.floats(0.5 * B, 0.95 * B)
pressures = st.floats(1e3, 8e5)


def slope(function: Any, at: float, step: float = 1e-6 * B) -> float:
    return float((function(at + step) - function(at - step)) / (2.0 * step))


@pytest.mark.parametrize("name", VIRTUAL_WORK)
@given(length=lengths, pressure=pressures)
def test_force_is_minus_pressure_times_volume_slope(
    name: str, length: float, pressure: float
) -> None:
    model = MODELS[name]
    work = -pressure * slope(model.volume, length)
    assert model.force(pressure, length) == pytest.approx(
        work, rel=1e-6, abs=1e-5 * pressure * B**2
    )


@pytest.mark.parametrize("name", MODELS)
@given(length=lengths, pressure=pressures)
def test_slopes_match_differences(name: str, length: float, pressure: float) -> None:
    model = MODELS[name]
    stiffness = slope(lambda at: model.force(pressure, at), length)
    assert model.stiffness(pressure, length) == pytest.approx(stiffness, rel=1e-5, abs=1e-2)
    assert model.volume_slope(length) == pytest.approx(slope(model.volume, length), abs=1e-8)


@pytest.mark.parametrize("name", MODELS)
@given(length=lengths, pressure=pressures, dead=st.floats(1e-6, 1e-3), exponent=st.floats(1, 1.4))
def test_closed_stiffness_follows_the_trapped_gas(
    name: str, length: float, pressure: float, dead: float, exponent: float
) -> None:
    model, ambient = MODELS[name], 101325.0
    kept = (pressure + ambient) * (model.volume(length) + dead) ** exponent

    def shut(at: float) -> float:
        now = kept / (model.volume(at) + dead) ** exponent - ambient
        return float(model.force(now, at))

    stiffness = model.closed_stiffness(
        pressure, length, dead_volume=dead, ambient_pressure=ambient, exponent=exponent
    )
    assert stiffness == pytest.approx(slope(shut, length), rel=1e-4, abs=0.5)


@given(length=lengths, pressure=pressures)
def test_special_cases_coincide(length: float, pressure: float) -> None:
    ideal = Gaylord(B, N)
    for special in (
        ChouHannaford(B, N, 0.0),
        ChouHannaford(B, N, 1e-12),
        ChouHannafordIncompressible(B, N, REST, WALL),
        TonduLopez(B, N, REST, 1.0),
    ):
        force = ideal.force(pressure, length)
        assert special.force(pressure, length) == pytest.approx(force, rel=1e-6, abs=1e-3)
        stiffness = ideal.stiffness(pressure, length)
        assert special.stiffness(pressure, length) == pytest.approx(stiffness, rel=1e-6)


@given(scale=st.floats(0.1, 10), length=lengths, pressure=pressures)
def test_dimensions(scale: float, length: float, pressure: float) -> None:
    for small, large in (
        (Gaylord(B, N), Gaylord(B * scale, N)),
        (ChouHannaford(B, N, WALL), ChouHannaford(B * scale, N, WALL * scale)),
        (TonduLopez(B, N, REST, 1.2), TonduLopez(B * scale, N, REST * scale, 1.2)),
    ):
        at = length * scale
        for few, factor in ((small.force, scale**2), (small.stiffness, scale)):
            many = getattr(large, few.__name__)
            assert many(pressure, at) == pytest.approx(factor * few(pressure, length), abs=1e-6)
        assert large.volume(at) == pytest.approx(scale**3 * small.volume(length), rel=1e-9)


def test_neutral_angle_and_stroke() -> None:
    ideal = Gaylord(B, N)
    neutral = B * math.cos(braid.NEUTRAL_ANGLE)
    assert math.degrees(braid.NEUTRAL_ANGLE) == pytest.approx(54.735610317245)
    assert ideal.force(3e5, neutral) == pytest.approx(0.0, abs=1e-9)
    assert ideal.force(3e5, 0.99 * neutral) < 0.0 < ideal.force(3e5, 1.01 * neutral)
    assert ideal.volume(neutral) > max(ideal.volume(0.99 * neutral), ideal.volume(1.01 * neutral))
    muscle = TonduLopez(B, N, REST, 1.3)
    shortest = REST * (1.0 - muscle.maximum_contraction)
    assert muscle.force(3e5, shortest) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_arrays_broadcast_and_agree_with_floats(name: str) -> None:
    model = MODELS[name]
    at = np.linspace(0.6 * B, 0.9 * B, 4)
    push = np.array([[1e5], [4e5]])
    forces = model.force(push, at)
    assert forces.shape == (2, 4)
    for row, pressure in enumerate(push[:, 0]):
        for column, length in enumerate(at):
            assert forces[row, column] == pytest.approx(
                model.force(float(pressure), float(length)), rel=1e-12
            )
    assert model.volume(at).shape == model.volume_slope(at).shape == (4,)
    assert type(model.force(1e5, 0.22)) is float


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("length", [0.0, -0.1, 1.001 * B, math.nan, math.inf])
def test_length_outside_the_domain_is_refused(name: str, length: float) -> None:
    model = MODELS[name]
    for refused in (length, np.array([0.22, length])):
        for method in (model.coefficients, model.coefficient_slopes, model.volume_slope):
            with pytest.raises(DomainError, match="is outside"):
                method(refused)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Gaylord(0.0, N), "thread_length = 0 must be above 0"),
        (lambda: Gaylord(B, math.nan), "turns = nan must be above 0"),
        (lambda: ChouHannaford(B, N, -1e-3), "must be 0 or above"),
        (lambda: ChouHannaford(B, N, 0.03), "fills the braid"),
        (lambda: ChouHannafordIncompressible(B, N, REST, 0.011), "fills the braid"),
        (lambda: ChouHannafordIncompressible(B, N, B, WALL), "rest_length"),
        (lambda: TonduLopez(B, N, 0.5 * B), "must be below 54.74 deg"),
        (lambda: TonduLopez(B, N, 1.1 * B), "rest_length"),
        (lambda: TonduLopez(B, N, REST, -1.0), "k = -1 must be above 0"),
    ],
)
def test_impossible_muscle_is_refused(make: Any, reason: str) -> None:
    with pytest.raises(DomainError, match=reason):
        make()


@pytest.mark.parametrize("name", ["gaylord", "chou_hannaford", "tondu_lopez"])
def test_models_are_found_by_name(name: str) -> None:
    model = create_force_model(name, MuscleGeometry(B, N, REST, 0.001))
    assert isinstance(model, AffineForceModel)
    assert name in registered_models()


def test_register_refuses_what_no_model_has() -> None:
    geometry = MuscleGeometry(B, N, REST)
    with pytest.raises(RigError, match="unknown force model 'chou'; known: "):
        create_force_model("chou", geometry)
    with pytest.raises(RigError, match="unknown constant q"):
        create_force_model("tondu_lopez", geometry, {"q": 1.0})
    with pytest.raises(RigError, match=r"k = 9 - is outside \[0.5, 5\]"):
        create_force_model("tondu_lopez", geometry, {"k": 9.0})
