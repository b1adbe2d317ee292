"""Bending muscles: limits, virtual work, two methods that agree, scaling, domains."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.atlas.bending.contraction_bending import ContractionBending
from pam_model.atlas.bending.extensor_bending import ExtensorBending
from pam_model.atlas.bending.extensor_contractor_bending import ExtensorContractorBending
from pam_model.atlas.bending.inflated_beam import InflatedBeam
from pam_model.atlas.bending.reinforced_braid import ReinforcedBraid
from pam_model.atlas.bending.symmetric_pair import (
    SymmetricBendingPair,
    moment_by_force_balance,
    moment_by_virtual_work,
)
from pam_model.atlas.bending.three_muscle_segment import Arc, ThreeMuscleSegment
from pam_model.errors import DomainError
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.muscles.models.gaylord import Gaylord

threads = st.floats(0.1, 1.0)
turns = st.floats(1.0, 6.0)
wide_angles = st.floats(math.radians(60.0), math.radians(85.0))
fractions = st.floats(0.01, 0.99)
pressures = st.floats(1e4, 8e5)


def extensor_angle(largest: float, fraction: float) -> float:
    neutral = math.acos(1.0 / math.sqrt(3.0))
    return neutral + fraction * (largest - neutral)


@given(b=threads, n=turns, largest=wide_angles, fraction=fractions, pressure=pressures)
def test_extensor_moment_is_virtual_work(
    b: float, n: float, largest: float, fraction: float, pressure: float
) -> None:
    muscle = ExtensorBending(b, n, largest)
    angle = muscle.braid.bend(extensor_angle(largest, fraction))
    h = 1e-5 * max(angle, 1e-2)
    work = pressure * (muscle.volume(angle + h) - muscle.volume(max(angle - h, 0.0)))
    work /= angle + h - max(angle - h, 0.0)
    scale = pressure * muscle.volume(angle)
    assert muscle.moment(pressure, angle) == pytest.approx(work, rel=1e-5, abs=1e-6 * scale)
    slope = -(muscle.moment(pressure, angle + h) - muscle.moment(pressure, angle)) / h
    assert muscle.stiffness(pressure, angle) == pytest.approx(slope, rel=1e-3, abs=1e-4 * scale)


@given(b=threads, n=turns, largest=wide_angles, fraction=fractions)
def test_extensor_geometry(b: float, n: float, largest: float, fraction: float) -> None:
    muscle = ExtensorBending(b, n, largest)
    theta = extensor_angle(largest, fraction)
    state = muscle.state(1e5, theta)
    assert state.angle == pytest.approx((state.free_length - state.fixed_length) / state.diameter)
    inner_radius = state.fixed_length / state.angle
    assert inner_radius * state.angle == pytest.approx(state.fixed_length)
    assert muscle.braid.thread_angle(state.angle) == pytest.approx(theta, rel=1e-9)
    assert state.angle > muscle.braid.bend(theta + 0.5 * (largest - theta))


def test_straight_extensor_pushes_with_half_its_diameter() -> None:
    largest = math.radians(75.0)
    muscle = ExtensorBending(0.4, 3.0, largest)
    push = -Gaylord(0.4, 3.0).force(2e5, muscle.braid.fixed_length)
    lever = 0.5 * muscle.braid.diameter(largest)
    assert muscle.moment(2e5, 0.0) == pytest.approx(push * lever, rel=1e-12)


@given(
    b=threads,
    n=turns,
    fixed=st.floats(0.3, 1.4),
    free=st.floats(0.3, 1.4),
    wall=st.floats(0.0, 0.2),
    pressure=pressures,
)
def test_virtual_work_and_force_balance_agree(
    b: float, n: float, fixed: float, free: float, wall: float, pressure: float
) -> None:
    smallest = b * (math.sin(fixed) + math.sin(free)) / (2.0 * n * math.pi)
    braid = ReinforcedBraid(b, n, fixed, 0.5 * wall * smallest)
    work = moment_by_virtual_work(braid, pressure, free)
    try:
        balance = moment_by_force_balance(braid, pressure, free)
    except DomainError:
        assert braid.bend(free) < 0.0  # only bent far back do the threads lose their hold
        return
    scale = pressure * b**3 / n**2
    assert balance == pytest.approx(work, rel=1e-9, abs=1e-11 * scale)


@given(first=pressures, second=pressures, angle=st.floats(-1.0, 1.0))
def test_pair_is_symmetric(first: float, second: float, angle: float) -> None:
    pair = SymmetricBendingPair(ReinforcedBraid(0.4, 3.0, math.radians(75.0), 1e-3))
    there, back = pair.moment((first, second), angle), pair.moment((second, first), -angle)
    assert there == pytest.approx(-back, rel=1e-12)
    assert pair.moment((first, first), 0.0) == pytest.approx(0.0, abs=1e-12)
    assert pair.moment((first, second), angle, "force_balance") == pytest.approx(
        there, rel=1e-9, abs=1e-9
    )


@given(
    b=threads,
    n=turns,
    rest=st.floats(0.2, 0.8),
    contraction=st.floats(0.01, 0.2),
    s=st.floats(0.1, 9),
)
def test_contraction_bending_scales_and_returns(
    b: float, n: float, rest: float, contraction: float, s: float
) -> None:
    muscle, larger = ContractionBending(b, n, rest), ContractionBending(s * b, n, rest)
    angle = muscle.angle(contraction)
    assert angle > 0.0
    assert muscle.contraction(angle) == pytest.approx(contraction, rel=1e-6)
    assert larger.angle(contraction) == pytest.approx(angle)
    assert larger.moment(3e5, angle) == pytest.approx(s**3 * muscle.moment(3e5, angle), rel=1e-9)
    h = 1e-5
    work = 3e5 * (muscle.volume(angle + h) - muscle.volume(angle)) / h
    scale = 3e5 * muscle.volume(angle)
    assert muscle.moment(3e5, angle) == pytest.approx(work, rel=1e-3, abs=1e-4 * scale)


@given(
    length=st.floats(0.05, 1.0),
    bend=st.floats(1e-4, 0.9),
    direction=st.floats(-3.1, 3.1),
    radius=st.floats(0.005, 0.1),
)
def test_three_muscles_there_and_back(
    length: float, bend: float, direction: float, radius: float
) -> None:
    segment = ThreeMuscleSegment(radius)
    arc = segment.arc(segment.lengths(Arc(length, bend / radius, direction)))
    assert arc.length == pytest.approx(length, rel=1e-12)
    assert arc.curvature == pytest.approx(bend / radius, rel=1e-9)
    assert math.cos(arc.direction - direction) == pytest.approx(1.0, abs=1e-9)


def test_segment_bends_towards_the_muscle_that_pulls() -> None:
    segment = ThreeMuscleSegment(0.02)
    assert segment.moments([10.0, 10.0, 10.0]) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert segment.moments([20.0, 10.0, 10.0]) == pytest.approx((0.2, 0.0), abs=1e-12)
    assert segment.arc([0.2, 0.2, 0.2]).curvature == 0.0
    x, y, _ = segment.tip(segment.arc([0.18, 0.2, 0.2]))
    assert x > 0.0
    assert y == pytest.approx(0.0, abs=1e-12)


@given(contractor=pressures, extensor=pressures, angle=st.floats(-0.5, 1.0))
def test_limb_finds_its_pressures_back(contractor: float, extensor: float, angle: float) -> None:
    limb = ExtensorContractorBending(
        create_force_model("gaylord", MuscleGeometry(0.25, 2.0, 0.235)),
        create_force_model("gaylord", MuscleGeometry(0.5, 4.0, 0.171)),
        0.235,
        0.171,
        0.015,
    )
    moment = limb.moment(contractor, extensor, angle)
    stiffness = limb.stiffness(contractor, extensor, angle)
    h = 1e-6
    slope = -(limb.moment(contractor, extensor, angle + h) - moment) / h
    assert stiffness == pytest.approx(slope, rel=1e-3)
    found = limb.pressures_for(moment, stiffness, angle)
    assert found == pytest.approx((contractor, extensor), rel=1e-6)
    with pytest.raises(DomainError, match="at least 0"):
        limb.pressures_for(-1e3, stiffness, angle)


@given(pressure=pressures, fraction=st.floats(0.501, 0.99))
def test_beam_continues_into_membrane(pressure: float, fraction: float) -> None:
    beam = InflatedBeam(0.01, 1e6, 1e-3)
    onset = beam.wrinkle_onset(pressure)
    assert beam.wrinkled(pressure, 0.0) == pytest.approx((onset, beam.beam_curvature(onset)))
    moment = fraction * beam.collapse_moment(pressure)
    curvature = beam.curvature(pressure, moment)
    assert curvature > beam.beam_curvature(moment)
    assert beam.curvature(pressure, 0.5 * moment) == beam.beam_curvature(0.5 * moment)


def test_domains_are_named() -> None:
    with pytest.raises(DomainError, match="largest_angle"):
        ExtensorBending(0.4, 3.0, 0.5)
    with pytest.raises(DomainError, match="thread_angle"):
        ExtensorBending(0.4, 3.0, 1.3).state(1e5, 1.35)
    with pytest.raises(DomainError, match=r"bore.*wall"):
        ExtensorBending(0.4, 3.0, 1.3, 0.05).moment(1e5, 0.1)
    with pytest.raises(DomainError, match="rest_angle"):
        ContractionBending(0.25, 2.0, 1.2)
    with pytest.raises(DomainError, match="folds"):
        ThreeMuscleSegment(0.02).lengths(Arc(0.2, 60.0, 0.0))
    with pytest.raises(DomainError, match="collapses"):
        InflatedBeam(0.01, 1e6, 1e-3).curvature(1e5, 1.0)
    with pytest.raises(DomainError, match="virtual_work"):
        SymmetricBendingPair(ReinforcedBraid(0.4, 3.0, 1.3)).moment((0.0, 0.0), 0.1, "guess")  # type: ignore[arg-type]
