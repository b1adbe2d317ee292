"""Braids that taper to their fittings, and the static models built on them."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.muscles.models.doumit_fahim import DoumitFahim
from pam_model.muscles.models.friction_loss_static import FrictionLossStatic
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.muscles.models.li_static import LiStatic
from pam_model.muscles.rubber_wall import RubberWall
from pam_model.muscles.thread_friction import ThreadFriction

B, N = 0.25, 2.0
D90 = B / (N * math.pi)


@given(
    slant=st.floats(0.3, 2.0),
    fitting=st.floats(0.1, 1.2),
    fraction=st.floats(0.001, 0.999),
)
def test_middle_length_is_found_again(slant: float, fitting: float, fraction: float) -> None:
    assume(fitting - 2.0 * slant < 0.95)
    muscle = DoumitFahim(B, N, slant * D90, fitting * D90)
    low, high = muscle.middle_bounds
    middle = low + fraction * (high - low)
    state = muscle.state(middle)
    back = muscle.middle_length(state.length)
    # where the length hardly changes with the middle, the middle is known less well
    assert muscle.state(back).length == pytest.approx(state.length, rel=1e-13)
    assert back == pytest.approx(middle, rel=1e-10 + 1e-14 / state.length1, abs=1e-9)


@given(slant=st.floats(0.3, 2.0), fitting=st.floats(0.1, 1.2))
def test_length_rises_with_the_middle(slant: float, fitting: float) -> None:
    assume(fitting - 2.0 * slant < 0.95)
    muscle = DoumitFahim(B, N, slant * D90, fitting * D90)
    low, high = muscle.middle_bounds
    middles = np.linspace(low, high, 202)[1:-1]
    state = muscle.state(middles)
    assert np.all(np.diff(state.length) > 0.0)
    assert np.all(state.length1 > 0.0)


@given(fraction=st.floats(0.05, 0.95), pressure=st.floats(1e3, 8e5))
def test_at_the_fittings_diameter_it_is_a_cylinder(fraction: float, pressure: float) -> None:
    """Where D = d the cones are a cylinder of rigid length: only their swelling adds work."""
    middle = fraction * B
    size = math.sqrt(B**2 - middle**2) / (math.pi * N)
    muscle = DoumitFahim(B, N, 0.01, size)
    state = muscle.state(middle)
    assert state.length == pytest.approx(middle + 0.02)
    assert state.length1 == pytest.approx(1.0)
    ends = -pressure * math.pi * 0.01 * size * 0.5 * (-middle / (math.pi**2 * N**2 * size))
    expected = Gaylord(B, N).force(pressure, middle) + ends
    assert muscle.force(pressure, state.length) == pytest.approx(
        expected, rel=1e-6, abs=1e-6 * pressure * size**2
    )


def test_short_cones_vanish() -> None:
    """Cones of no length leave the cylinder, as long as braid and fitting agree."""
    middle = 0.2
    size = math.sqrt(B**2 - middle**2) / (math.pi * N)
    muscle = DoumitFahim(B, N, 1e-6, size)
    force = muscle.force(3e5, muscle.state(middle).length)
    assert force == pytest.approx(Gaylord(B, N).force(3e5, middle), rel=1e-3)


def test_cones_that_cannot_join_are_refused() -> None:
    with pytest.raises(DomainError, match="2 cone_slant"):
        DoumitFahim(B, N, 0.005, 0.06)
    with pytest.raises(DomainError, match="2 cone_slant"):
        DoumitFahim(B, N, 0.005, 0.01).state(0.05)
    with pytest.raises(DomainError, match="2 cone_slant"):
        create_force_model("doumit_fahim", MuscleGeometry(B, N, 0.2), {"cone_slant": 1e-3})
    with pytest.raises(DomainError, match="no cylinder"):
        create_force_model("doumit_fahim", MuscleGeometry(B, N, 0.2), {"cone_slant": 0.2})


def test_a_rigs_muscle_keeps_its_size_at_rest() -> None:
    geometry = MuscleGeometry(B, N, 0.22)
    muscle = create_force_model("doumit_fahim", geometry)
    assert isinstance(muscle, DoumitFahim)
    state = muscle.at(0.22)
    assert state.diameter == pytest.approx(math.sqrt(B**2 - 0.22**2) / (math.pi * N))


def composites(friction: float, rubber: float) -> tuple[FrictionLossStatic, LiStatic]:
    bladder = RubberWall.thin(B, N, 0.2, c10=rubber, c01=rubber, volume=3e-6)
    threads = ThreadFriction(N, friction, 3e-4)
    return (
        FrictionLossStatic(B, N, 0.02, 0.012, bladder=bladder, friction=threads),
        LiStatic(B, N, 0.02, 0.012, bladder=bladder, friction=threads),
    )


@given(middle=st.floats(0.12, 0.23), pressure=st.floats(0.0, 8e5), speed=st.floats(-1.0, 1.0))
def test_composites_reduce_to_their_parts(middle: float, pressure: float, speed: float) -> None:
    energy, balance = composites(0.0, 0.0)
    length = energy.state(middle).length
    ends = DoumitFahim(B, N, 0.02, 0.012)
    assert energy.force(pressure, length, speed) == pytest.approx(ends.force(pressure, length))
    assert balance.force(pressure, length, speed) == pytest.approx(
        Gaylord(B, N).force(pressure, middle), rel=1e-8, abs=1e-6
    )


@given(middle=st.floats(0.12, 0.23), pressure=st.floats(1e3, 8e5))
def test_thread_friction_follows_its_geometry(middle: float, pressure: float) -> None:
    """(4/3) mu eta P pi D L a/(b sin theta), the diameter and the angle written out."""
    angle = math.acos(middle / B)
    diameter = B * math.sin(angle) / (N * math.pi)
    force = 4.0 / 3.0 * 0.1 * 0.8 * pressure * math.pi * diameter * middle * 3e-4
    friction = ThreadFriction(N, 0.1, 3e-4, 0.8).per_pressure(middle)
    assert friction * pressure == pytest.approx(force / (B * math.sin(angle)))
    _, balance = composites(0.1, 1e5)
    length = balance.state(middle).length
    loss = balance.force(pressure, length) - balance.force(pressure, length, -0.1)
    assert loss == pytest.approx(force / 0.8 / (B * math.sin(angle)), rel=1e-6)
