"""Rigs of other sizes and kinds: a scaled rig moves as the drawn one, and its forces are larger."""

from dataclasses import asdict

import numpy as np
import pytest

from pam_check.blind.cases import written_rig
from pam_check.blind.draw import Draw, draw_excitation
from pam_check.blind.effect_cases import KNOWN, OUTSIDE, case_of
from pam_check.blind.rough import STRENGTHS, draw_rough_rig
from pam_check.blind.truth_plant import Sensors, TruthJoint, TruthMuscle, run_truth
from pam_check.blind.variety import INNER_GAIN, Variety, draw_variety

pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")

JOINT = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
MUSCLE = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)
SILENT = Sensors(0.0, 1e-6, 0.0, 1e-9, 0.0, 1e-9)


@pytest.mark.parametrize("effect", sorted(KNOWN | OUTSIDE))
def test_a_scaled_rig_moves_as_the_drawn_one(effect: str) -> None:
    """A number with a wrong power of the scale would change angles or pressures."""
    rig = Draw(np.random.default_rng(5), JOINT, [MUSCLE, MUSCLE])
    case_of(effect).draw(rig)
    first, second = rig.muscles
    motion = draw_excitation(np.random.default_rng(6), JOINT, 0.002, 3.0)
    drawn = run_truth(rig.joint, (first, second), motion, SILENT, np.random.default_rng(7))
    kind = Variety(scale=0.2)
    scaled = run_truth(
        kind.joint(rig.joint),
        (kind.muscle(first), kind.muscle(second)),
        motion,
        SILENT,
        np.random.default_rng(7),
    )
    assert np.ptp(drawn.true_position) > 0.05
    np.testing.assert_allclose(scaled.true_position, drawn.true_position, atol=1e-4)
    np.testing.assert_allclose(scaled.true_pressures, drawn.true_pressures, atol=20.0)
    np.testing.assert_allclose(scaled.forces, 0.04 * drawn.forces, atol=0.02)


def test_drawn_kinds_reach_from_small_to_large_and_from_one_valve_to_the_other() -> None:
    kinds = [draw_variety(np.random.default_rng(k), regulators=True) for k in range(200)]
    forces = [700.0 * kind.scale**2 for kind in kinds]
    assert min(forces) < 15.0
    assert max(forces) > 4000.0
    assert {kind.rows for kind in kinds} == {1, 5, 10}
    for name in ("horizontal", "slow"):
        assert {getattr(kind, name) for kind in kinds} == {False, True}
    assert 0.1 < np.mean([kind.regulator_time > 0.0 for kind in kinds]) < 0.4
    assert draw_variety(np.random.default_rng(0), regulators=False).regulator_time == 0.0
    hidden = Variety(regulator_time=0.02).hidden
    assert hidden
    assert all(case_of(effect).fades_behind_a_regulator for effect in hidden)
    assert Variety().hidden == frozenset()
    assert set(asdict(kinds[0])) == set(Variety.__slots__)


def test_a_regulator_brings_the_commanded_pressure() -> None:
    muscle = MUSCLE._replace(regulator=INNER_GAIN, time_constant=0.02)
    motion = draw_excitation(np.random.default_rng(6), JOINT, 0.002, 3.0)
    made = run_truth(JOINT, (muscle, muscle), motion, SILENT, np.random.default_rng(7))
    assert made.commands.min() > 1e4  # pressures, not openings
    late = round(0.04 / motion.sample_time)
    error = made.true_pressures[late:] - made.commands[:-late]
    assert np.median(np.abs(error)) < 0.02 * np.ptp(made.commands)


def test_gravity_acts_on_no_load_of_a_horizontal_joint() -> None:
    kind = Variety(horizontal=True)
    believed = kind.believed(JOINT, MUSCLE)
    rig = draw_rough_rig(
        believed,
        written_rig(kind, believed, 0.03),
        ["payload"],
        np.random.default_rng(3),
        variety=kind,
    )
    assert rig.joint.gravity_torque == 0.0
    assert rig.joint.inertia > JOINT.inertia


def test_each_of_two_effects_has_its_own_strength() -> None:
    kind = Variety()
    believed = kind.believed(JOINT, MUSCLE)
    effects = ["viscous_friction", "pressure_lag"]
    rig = draw_rough_rig(
        believed, written_rig(kind, believed, 0.03), effects, np.random.default_rng(3), variety=kind
    )
    weakest = STRENGTHS["weak"][0]
    assert min(rig.strengths) > 0.8 * weakest
