"""Mooney-Rivlin walls, thin and thick, and the muscles that carry them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from pam_model.errors import DomainError
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.muscles.models.ashwin_ghosal import AshwinGhosal
from pam_model.muscles.models.braid_bladder import BraidBladder
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.martens_boblan import MartensBoblan
from pam_model.muscles.models.shen_shi import ShenShi
from pam_model.muscles.rubber_wall import RubberWall, tube_volume
from pam_model.muscles.thread_friction import ThreadFriction

B, N = 0.25, 2.0
rests = st.floats(0.1, 0.24)
constants = st.floats(0.0, 1e6)


@given(rest=rests, c10=constants, c01=constants, fraction=st.floats(0.05, 0.98))
def test_thin_wall_costs_energy_everywhere_but_at_rest(
    rest: float, c10: float, c01: float, fraction: float
) -> None:
    wall = RubberWall.thin(B, N, rest, c10=c10, c01=c01, volume=3e-6)
    assert wall.energy(fraction * B) >= -1e-12
    assert wall.energy(rest) == pytest.approx(0.0, abs=1e-12)
    assert wall.force(rest) == pytest.approx(0.0, abs=1e-9)
    assert wall.stiffness(rest) >= 0.0


@given(rest=rests, fraction=st.floats(0.3, 0.98))
def test_thin_wall_pulls_back_to_its_rest_length(rest: float, fraction: float) -> None:
    wall = RubberWall.thin(B, N, rest, c10=1e5, c01=0.0, volume=3e-6)
    length = fraction * B
    assert wall.force(length) * (length - rest) >= 0.0


@given(rest=st.floats(0.12, 0.24), fraction=st.floats(0.5, 0.97))
@settings(deadline=None)
def test_thick_wall_holds_the_energy_of_its_rings(rest: float, fraction: float) -> None:
    """Against the energy of thin rings, summed by quadrature of its own."""
    c10, c01, length = 1.2e5, 0.8e5, fraction * B
    outer_rest = math.sqrt(B**2 - rest**2) / (2.0 * math.pi * N)
    outer = math.sqrt(B**2 - length**2) / (2.0 * math.pi * N)
    inner_rest = 0.8 * outer_rest

    def ring(radius: float) -> float:
        axial = length / rest
        hoop = math.sqrt(outer**2 - (outer_rest**2 - radius**2) / axial) / radius
        across = 1.0 / (axial * hoop)
        first = axial**2 + hoop**2 + across**2 - 3.0
        second = axial**-2 + hoop**-2 + across**-2 - 3.0
        return (c10 * first + c01 * second) * 2.0 * math.pi * radius * rest

    if outer**2 <= (outer_rest**2 - inner_rest**2) * rest / length * 1.3:
        return  # the rubber nearly closes the bore
    wall = RubberWall.thick(B, N, rest, c10=c10, c01=c01, thickness=0.2 * outer_rest)
    energy, _ = quad(ring, inner_rest, outer_rest, epsabs=1e-12, epsrel=1e-10)
    assert wall.energy(length) == pytest.approx(energy, rel=1e-5, abs=1e-9)


@given(rest=rests, thickness=st.floats(1e-6, 1e-4), fraction=st.floats(0.6, 0.95))
def test_a_thinning_wall_becomes_the_thin_one(
    rest: float, thickness: float, fraction: float
) -> None:
    thick = RubberWall.thick(B, N, rest, c10=1e5, c01=1e5, thickness=thickness)
    volume = tube_volume(B, N, rest, thickness)
    thin = RubberWall.thin(B, N, rest, c10=1e5, c01=1e5, volume=volume)
    assert thick.volume == pytest.approx(volume)
    length = fraction * B
    outer = math.sqrt(B**2 - length**2) / (2.0 * math.pi * N)
    # layers differ from the braid by up to thickness over radius
    tolerance = 40.0 * thickness / min(outer, math.sqrt(B**2 - rest**2) / (2.0 * math.pi * N))
    assert thick.energy(length) == pytest.approx(thin.energy(length), rel=tolerance, abs=1e-6)


@given(fraction=st.floats(0.3, 0.95), pressure=st.floats(0.0, 8e5))
def test_muscles_without_rubber_are_ideal(fraction: float, pressure: float) -> None:
    length, ideal = fraction * B, Gaylord(B, N)
    bare = [
        BraidBladder(B, N, 0.2, c10=1e5, c01=1e5, bladder_volume=0.0),
        AshwinGhosal(B, N, 0.2, c10=1e5, c01=1e5, wall_thickness=0.0),
        MartensBoblan(B, N, 0.2, 0.0, modulus=(1e6, 0.0, 0.0, 0.0)),
        ShenShi(B, N, 0.2, 0.0, c10=1e5, c01=1e5, friction=ThreadFriction(N, 0.0, 0.0)),
    ]
    for muscle in bare:
        assert muscle.force(pressure, length) == pytest.approx(
            ideal.force(pressure, length), rel=1e-12, abs=1e-12
        )


@given(angle=st.floats(0.1, 1.2))
def test_bladder_of_the_miniature_muscle_keeps_its_volume(angle: float) -> None:
    muscle = AshwinGhosal(0.06, 4.0, 0.05, c10=1e5, c01=1e5, wall_thickness=2e-4)
    axial, hoop, across = muscle.stretches(muscle.length_at(angle))
    assert axial * hoop * across == pytest.approx(1.0)


def test_inactive_length_shifts_and_shortens() -> None:
    geometry = MuscleGeometry(B, N, 0.2, 1e-3)
    whole = create_force_model("ashwin_ghosal", geometry)
    part = create_force_model("ashwin_ghosal", geometry, {"inactive_length": 0.04})
    assert part.length_bounds[0] == pytest.approx(0.8 * whole.length_bounds[0] + 0.04)
    # the active part is a scaled muscle of the same diameter: same strain, same force
    assert part.force(3e5, 0.04 + 0.8 * 0.17) == pytest.approx(whole.force(3e5, 0.17))


@given(fraction=st.floats(0.5, 0.95))
def test_linear_wall_with_constant_modulus_has_an_energy(fraction: float) -> None:
    muscle = MartensBoblan(B, N, 0.2, 1e-3, modulus=(1e6, 0.0, 0.0, 0.0))
    length, step = fraction * B, 1e-6

    def energy(at: float) -> float:
        hoop = math.sqrt((B**2 - at**2) / (B**2 - 0.2**2)) - 1.0
        axial = at / 0.2 - 1.0
        return 0.5e6 * muscle.wall_volume * (hoop**2 + axial**2)

    pull = (energy(length + step) - energy(length - step)) / (2.0 * step)
    assert muscle.force(0.0, length) == pytest.approx(pull, rel=1e-6, abs=1e-6)


def test_refusals_name_quantity_and_bound() -> None:
    with pytest.raises(DomainError, match="rest_length"):
        RubberWall.thin(B, N, 0.3, c10=1e5, c01=1e5, volume=1e-6)
    with pytest.raises(DomainError, match="c10"):
        RubberWall.thin(B, N, 0.2, c10=-1.0, c01=1e5, volume=1e-6)
    with pytest.raises(DomainError, match="thickness"):
        RubberWall.thick(B, N, 0.2, c10=1e5, c01=1e5, thickness=0.05)
    with pytest.raises(DomainError, match="does not fit"):
        BraidBladder(B, N, 0.2, c10=1e5, c01=1e5, bladder_volume=1.0)
    muscle = BraidBladder(B, N, 0.2, c10=1e5, c01=1e5, bladder_volume=2e-5)
    with pytest.raises(DomainError, match="rubber fills"):
        muscle.force(1e5, np.array([0.2, 0.001]))
    with pytest.raises(DomainError, match="inactive_length"):
        create_force_model(
            "ashwin_ghosal", MuscleGeometry(B, N, 0.2, 1e-3), {"inactive_length": 0.2}
        )
