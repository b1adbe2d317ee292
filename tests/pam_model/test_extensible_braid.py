"""Threads that stretch: limits, energy, and the gas that swells the braid."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from pam_model.errors import DomainError
from pam_model.muscles.models.extensible_braid import ExtensibleBraid, thread_tension
from pam_model.muscles.models.gaylord import Gaylord

B, N, THREADS = 0.25, 2.0, 48.0
lengths = st.floats(0.3 * B, 0.99 * B)
pressures = st.floats(1e3, 8e5)
stiffnesses = st.floats(5e2, 1e5)


@given(length=lengths, pressure=pressures)
def test_stiff_threads_are_the_ideal_braid(length: float, pressure: float) -> None:
    muscle = ExtensibleBraid(B, N, THREADS, 1e12)
    ideal = Gaylord(B, N)
    assert muscle.force(pressure, length) == pytest.approx(
        ideal.force(pressure, length), rel=1e-5, abs=1e-5
    )


@given(length=lengths, pressure=pressures, stiffness=stiffnesses)
def test_thread_length_solves_hookes_law(length: float, pressure: float, stiffness: float) -> None:
    muscle = ExtensibleBraid(B, N, THREADS, stiffness)
    thread = muscle.stretched_thread(pressure, length)
    tension = thread_tension(pressure, thread, N, length, THREADS)
    assert thread == pytest.approx(B * (1.0 + tension / stiffness), rel=1e-12)


@given(length=st.floats(0.4 * B, 0.95 * B), pressure=pressures)
def test_the_threads_minimise_the_energy(length: float, pressure: float) -> None:
    """Gas work and the threads' energy settle at the same thread length, found by search."""
    muscle = ExtensibleBraid(B, N, THREADS, 2e3)

    def potential(growth: float) -> float:
        swell = length * (2.0 * B * growth + growth**2) / (4.0 * math.pi * N**2)
        return THREADS * 2e3 * growth**2 / (2.0 * B) - pressure * swell

    found = minimize_scalar(
        potential, bounds=(0.0, 0.5 * B), method="bounded", options={"xatol": 1e-11}
    ).x
    growth = muscle.stretched_thread(pressure, length) - B
    assert growth == pytest.approx(found, rel=1e-4, abs=1e-9)


@given(length=lengths, pressure=pressures, stiffness=stiffnesses)
def test_force_and_volume_share_one_potential(
    length: float, pressure: float, stiffness: float
) -> None:
    """-dF/dP at constant length is dV/dL at constant pressure."""
    muscle = ExtensibleBraid(B, N, THREADS, stiffness)
    step = 1e-5 * B
    swell = muscle.volume_under_pressure(pressure, length + step)
    swell -= muscle.volume_under_pressure(pressure, length - step)
    assert -muscle.pressure_slope(pressure, length) == pytest.approx(
        swell / (2.0 * step), rel=1e-5, abs=1e-9
    )


@given(length=st.floats(0.4 * B, 0.95 * B), pressure=pressures, dead=st.floats(1e-6, 1e-3))
def test_closed_stiffness_follows_the_trapped_gas(
    length: float, pressure: float, dead: float
) -> None:
    muscle, ambient, exponent = ExtensibleBraid(B, N, THREADS, 2e3), 101325.0, 1.3
    kept = (pressure + ambient) * (
        muscle.volume_under_pressure(pressure, length) + dead
    ) ** exponent

    def shut(at: float) -> float:
        trapped = pressure
        for _ in range(60):
            room = muscle.volume_under_pressure(trapped, at) + dead
            trapped = kept / room**exponent - ambient
        return float(muscle.force(trapped, at))

    step = 1e-5 * B
    expected = (shut(length + step) - shut(length - step)) / (2.0 * step)
    stiffness = muscle.closed_stiffness(
        pressure, length, dead_volume=dead, ambient_pressure=ambient, exponent=exponent
    )
    assert stiffness == pytest.approx(expected, rel=1e-4, abs=1.0)


def test_soft_threads_are_refused_where_they_run_away() -> None:
    muscle = ExtensibleBraid(B, N, THREADS, 10.0)
    with pytest.raises(DomainError, match="without bound"):
        muscle.force(np.array([1e3, 8e5]), 0.2)
