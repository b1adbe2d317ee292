"""Strands, jam limits and cells of a braid."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.muscles.braid_limits import BraidLimits
from pam_model.muscles.models.caldwell_cells import CaldwellCells
from pam_model.muscles.models.davis_caldwell import DavisCaldwell
from pam_model.muscles.models.gaylord import Gaylord

covers = st.floats(0.05, 0.99)


def braid(cover: float, strands: float = 120.0) -> BraidLimits:
    return BraidLimits(cover * math.pi * 0.03 / strands, strands, 0.03, 0.3)


@given(cover=covers, strands=st.floats(8.0, 400.0))
def test_strands_touch_at_both_limits(cover: float, strands: float) -> None:
    limits = braid(cover, strands)
    assert limits.gap(limits.minimum_angle) == pytest.approx(limits.strand_width)
    assert limits.gap(limits.lock_angle) == pytest.approx(limits.strand_width)
    assert limits.minimum_angle + limits.lock_angle == pytest.approx(math.pi / 2)
    between = np.linspace(limits.minimum_angle, limits.lock_angle, 20)[1:-1]
    assert np.all(limits.gap(between) > limits.strand_width)


@given(cover=st.floats(0.05, 0.8), more=st.floats(1.01, 1.2))
def test_more_or_wider_strands_cost_range(cover: float, more: float) -> None:
    limits = braid(cover)
    for other in (
        BraidLimits(limits.strand_width * more, 120.0, 0.03, 0.3),
        BraidLimits(limits.strand_width, 120.0 * more, 0.03, 0.3),
    ):
        assert other.minimum_angle > limits.minimum_angle
        assert other.longest_length < limits.longest_length
        assert other.contraction_range < limits.contraction_range


def test_half_the_strands_give_the_published_gain() -> None:
    """A cover whose half raises the peak force by 16 % lengthens the contraction by 7.4 %."""
    dense, loose = braid(0.6365, 240.0), braid(0.6365 / 2.0, 120.0)
    peak = [3.0 * math.cos(limits.minimum_angle) ** 2 - 1.0 for limits in (dense, loose)]
    assert peak[1] / peak[0] == pytest.approx(1.16, abs=1e-3)
    gain = loose.contraction_range / dense.contraction_range
    assert gain == pytest.approx(1.0737, abs=1e-3)


def test_circumference_is_that_of_the_cylinder() -> None:
    limits = braid(0.5)
    assert limits.circumference(math.pi / 2) == pytest.approx(math.pi * 0.03)
    assert limits.circumference(0.4) == pytest.approx(math.pi * 0.03 * math.sin(0.4))


def test_a_braid_that_cannot_be_is_refused() -> None:
    with pytest.raises(DomainError, match="pi D90"):
        BraidLimits(1e-3, 100.0, 0.03, 0.3)
    with pytest.raises(DomainError, match="strand_width"):
        BraidLimits(0.0, 100.0, 0.03, 0.3)


@given(fraction=st.floats(0.01, 0.99), pressure=st.floats(0.0, 8e5))
def test_between_the_jams_the_force_is_ideal(fraction: float, pressure: float) -> None:
    muscle = DavisCaldwell(0.25, 2.0, 3e-4, 120.0)
    low, high = muscle.length_bounds
    length = low + fraction * (high - low)
    assert muscle.force(pressure, length) == Gaylord(0.25, 2.0).force(pressure, length)
    with pytest.raises(DomainError, match="jam"):
        muscle.force(pressure, 0.5 * (high + 0.25))


@given(
    along=st.floats(5.0, 200.0),
    around=st.floats(5.0, 100.0),
    side=st.floats(1e-4, 1e-2),
    angle=st.floats(0.05, 1.5),
    pressure=st.floats(0.0, 8e5),
)
def test_cells_are_the_ideal_cylinder(
    along: float, around: float, side: float, angle: float, pressure: float
) -> None:
    cells = CaldwellCells(along, around, side)
    ideal = Gaylord(2.0 * along * side, along / around)
    length = float(cells.length(angle))
    assert cells.force(pressure, length) == ideal.force(pressure, length)
    diameter = ideal.thread_length * math.sin(angle) / (ideal.turns * math.pi)
    assert cells.diameter(angle) == pytest.approx(diameter)
