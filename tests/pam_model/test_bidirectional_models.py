"""Muscles that pull and push: sleeve, set thread angle, contractor in extensor."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.muscles.braid import NEUTRAL_ANGLE, ThinCylinder
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.muscles.models.al_fahaam import AlFahaam, design_pair_forces
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.variable_thread_angle import VariableThreadAngle
from pam_model.muscles.models.zheng_shen import ZhengShen

B, N = 0.25, 2.0
D90 = B / (N * math.pi)
pressures = st.floats(0.0, 8e5)


# --- sleeve ---


@given(share=st.floats(0.0, 0.9), fraction=st.floats(0.05, 0.95), pressure=pressures)
def test_a_rod_adds_its_section_and_saves_its_volume(
    share: float, fraction: float, pressure: float
) -> None:
    sleeve = ZhengShen(B, N, share * D90)
    length = fraction * sleeve.length_bounds[1]
    rod = math.pi * (share * D90) ** 2 / 4.0
    ideal = Gaylord(B, N)
    assert sleeve.force(pressure, length) == pytest.approx(
        ideal.force(pressure, length) + pressure * rod, rel=1e-9, abs=1e-6
    )
    assert sleeve.gas_ratio(length) == pytest.approx(sleeve.volume(length) / ideal.volume(length))


def test_published_gas_savings_need_rods_of_half_the_diameter() -> None:
    length = 0.2
    diameter = math.sqrt(B**2 - length**2) / (math.pi * N)
    for rod, saved in ((0.447, 0.20), (0.608, 0.37)):
        sleeve = ZhengShen(B, N, rod * diameter)
        assert 1.0 - sleeve.gas_ratio(length) == pytest.approx(saved, abs=2e-3)


@given(pressure=pressures, push=pressures)
def test_second_chamber_pushes(pressure: float, push: float) -> None:
    sleeve = ZhengShen(B, N, 0.005, 0.008, push)
    assert sleeve.force(pressure, 0.2) == pytest.approx(sleeve.net_force(pressure, push, 0.2))
    assert sleeve.net_force(0.0, push, 0.2) == pytest.approx(-push * math.pi * 0.008**2 / 4.0)


def test_a_rod_wider_than_the_braid_is_refused() -> None:
    with pytest.raises(DomainError, match="insert_diameter"):
        ZhengShen(B, N, 1.01 * D90)
    with pytest.raises(DomainError, match="touches the rod"):
        ZhengShen(B, N, 0.5 * D90).force(1e5, 0.249)


# --- set thread angle ---


@given(angle=st.floats(0.1, 1.5), pressure=st.floats(1.0, 8e5))
def test_force_at_rest_changes_sign_at_the_neutral_angle(angle: float, pressure: float) -> None:
    muscle = VariableThreadAngle(0.2, 0.02, angle)
    force = muscle.force(pressure, 0.2)
    scale = pressure * 0.02**2
    if abs(angle - NEUTRAL_ANGLE) > 1e-6:
        assert math.copysign(1.0, force) == math.copysign(1.0, NEUTRAL_ANGLE - angle)
    else:
        assert force == pytest.approx(0.0, abs=1e-3 * scale)


@given(angle=st.floats(0.1, 1.5), pressure=st.floats(1.0, 8e5))
def test_free_length_and_size_at_rest(angle: float, pressure: float) -> None:
    muscle = VariableThreadAngle(0.2, 0.02, 0.5).at_angle(angle)
    assert muscle.volume(0.2) == pytest.approx(math.pi * 0.02**2 / 4.0 * 0.2)
    assert muscle.force(pressure, 0.2 * muscle.free_length_ratio) == pytest.approx(
        0.0, abs=1e-9 * pressure * muscle.thread_length**2 / muscle.turns**2
    )
    assert muscle.free_contraction < 1.0 - 1.0 / math.sqrt(3.0)


def test_a_rig_may_leave_the_angle_to_its_geometry() -> None:
    muscle = create_force_model("variable_thread_angle", MuscleGeometry(B, N, 0.2))
    assert muscle.force(2e5, 0.17) == pytest.approx(Gaylord(B, N).force(2e5, 0.17))
    with pytest.raises(DomainError, match="rest_angle"):
        VariableThreadAngle(0.2, 0.02, math.pi / 2)


# --- contractor in extensor ---


def pair(extensor_pressure: float = 0.0, wall: float = 0.0) -> AlFahaam:
    return AlFahaam(
        ThinCylinder(0.3, 3.0), ThinCylinder(0.52, 2.6), extensor_pressure, wall_thickness=wall
    )


@given(length=st.floats(0.05, 0.29), pressure=pressures)
def test_equal_pressures_leave_the_outer_muscle(length: float, pressure: float) -> None:
    outer = Gaylord(0.52, 2.6).force(pressure, length)
    assert pair().pair_force(pressure, pressure, length) == pytest.approx(outer, abs=1e-9)


@given(length=st.floats(0.05, 0.29), pressure=pressures)
def test_without_annulus_pressure_it_is_the_contractor(length: float, pressure: float) -> None:
    assert pair().force(pressure, length) == Gaylord(0.3, 3.0).force(pressure, length)


@given(length=st.floats(0.05, 0.29), inner=pressures, outer=pressures)
def test_pressures_superpose_and_do_virtual_work(length: float, inner: float, outer: float) -> None:
    model, step = pair(), 1e-6
    force = model.pair_force(inner, outer, length)
    apart = model.pair_force(inner, 0.0, length) + model.pair_force(0.0, outer, length)
    assert force == pytest.approx(apart, rel=1e-9, abs=1e-6)
    assert pair(outer).force(inner, length) == pytest.approx(force, rel=1e-9, abs=1e-6)
    rise = [
        (volume(length + step) - volume(length - step)) / (2.0 * step)
        for volume in (model.volume, model.annulus_volume)
    ]
    assert force == pytest.approx(-inner * rise[0] - outer * rise[1], rel=1e-6, abs=1e-3)


@given(length=st.floats(0.2, 0.29), inner=st.floats(1e5, 6e5))
def test_stiffness_is_set_apart_from_force(length: float, inner: float) -> None:
    """Pressures with no net force add stiffness."""
    model = pair()
    pull = model.contractor.coefficients(length)[0]
    push = model.extensor.coefficients(length)[0] - pull
    outer = -inner * pull / push
    assert model.pair_force(inner, outer, length) == pytest.approx(0.0, abs=1e-9 * inner)
    assert model.pair_stiffness(inner, outer, length) > 0.0


def test_print_of_32_is_not_returned() -> None:
    """P_c = 0, P_e = 2 bar, 30 and 70 degrees: the print pulls 133 N, the pair pushes 612 N."""
    force, _, _ = design_pair_forces(
        0.3,
        3.0,
        contractor_pressure=0.0,
        extensor_pressure=2e5,
        contractor_angle=math.radians(30.0),
        extensor_angle=math.radians(70.0),
    )
    assert force == pytest.approx(-612.0, abs=1.0)


def test_design_ratios_give_a_wider_extensor() -> None:
    muscle = create_force_model("al_fahaam", MuscleGeometry(0.3, 3.0, 0.27))
    assert isinstance(muscle, AlFahaam)
    inner = muscle.contractor.thread_length / muscle.contractor.turns
    assert muscle.extensor.thread_length / muscle.extensor.turns == pytest.approx(2.0 * inner)


def test_a_closed_annulus_is_refused() -> None:
    with pytest.raises(DomainError, match="annulus"):
        AlFahaam(ThinCylinder(0.3, 3.0), ThinCylinder(0.3, 3.1))
    thick = pair(wall=0.019)
    low, _ = thick.length_bounds
    assert low > 0.0
    assert math.isfinite(thick.force(1e5, low + 1e-3))
    with pytest.raises(DomainError, match="annulus"):
        thick.force(1e5, low - 1e-3)
