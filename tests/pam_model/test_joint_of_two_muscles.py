"""The joint: torque and stiffness against finite differences, the inverse and its limits."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import DomainError
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.muscles.models.gaylord import Gaylord
from pam_model.rig import Rig, load_rig

CONFIG = Path(__file__).parents[2] / "config"
RIG = load_rig(CONFIG / "elbow.yaml")
LOW = 2e4
STRETCHING = {
    "bladder_elasticity": {"linear": 500.0, "cubic": 1e6},
    "end_caps": {"factor": 1.05},
    "threshold_pressure": {"pressure": 2e4},
    "braid_extensibility": {"compliance": 5e-7},
    "cable_compliance": {"compliance": 1e-5},
}
BLADDER = {"bladder_elasticity": {"linear": 800.0, "cubic": 1e6}}


def with_effects(effects: dict[str, dict[str, float]]) -> Rig:
    rig = RIG
    for muscle in RIG.muscles:
        rig = rig.with_muscle(replace(muscle, effects=effects))
    return rig


JOINTS = {
    "nominal": JointStatics.from_rig(RIG, "elbow", min_pressure=LOW),
    "bladder": JointStatics.from_rig(with_effects(BLADDER), "elbow", min_pressure=LOW),
    "stretching": JointStatics.from_rig(with_effects(STRETCHING), "elbow", min_pressure=LOW),
}
positions = st.floats(-1.0, 1.0)
pressures = st.floats(5e4, 6e5)


@pytest.mark.parametrize("vector", range(4))
def test_against_the_oracle(vector: int) -> None:
    entry = json.loads(Path(__file__).with_name("oracle.json").read_text(encoding="utf-8"))
    entry = entry["models"]["antagonistic_joint"]
    case = entry["vectors"][vector]
    at, out = case["in"], case["out"]
    model = Gaylord(at["b"], at["n"])
    joint = JointStatics(
        [JointMuscle(model, at[length], 0.0, 1e6) for length in ("L1_0", "L2_0")],
        [at["r"], -at["r"]],
    )
    torque = joint.torque((at["P1"], at["P2"]), at["phi"])
    stiffness = joint.stiffness((at["P1"], at["P2"]), at["phi"])
    assert torque == pytest.approx(out["tau"], rel=entry["rtol"], abs=entry["atol"])
    assert stiffness == pytest.approx(out["K_phi"], rel=entry["rtol"], abs=entry["atol"])


@pytest.mark.parametrize("name", JOINTS)
@given(agonist=pressures, antagonist=pressures, position=positions)
def test_torques_of_several_pairs_are_those_of_each_pair(
    name: str, agonist: float, antagonist: float, position: float
) -> None:
    joint, pairs = JOINTS[name], ((agonist, antagonist), (antagonist, 0.5 * agonist))
    alone = [joint.torque(pair, position) for pair in pairs]
    assert joint.torques(pairs, position) == pytest.approx(alone, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", JOINTS)
@given(agonist=pressures, antagonist=pressures, position=positions)
def test_inverse_finds_the_pressures_back(
    name: str, agonist: float, antagonist: float, position: float
) -> None:
    joint = JOINTS[name]
    if min(joint.tensions((agonist, antagonist), position)) <= 0.0:
        return
    torque = joint.torque((agonist, antagonist), position)
    stiffness = joint.stiffness((agonist, antagonist), position)
    found = joint.pressures_for(torque, stiffness, position)
    assert not (found.torque_limited or found.stiffness_limited or found.position_limited)
    assert found.agonist == pytest.approx(agonist, abs=1.0)
    assert found.antagonist == pytest.approx(antagonist, abs=1.0)


@pytest.mark.parametrize("name", JOINTS)
@given(torque=st.floats(-60, 60), stiffness=st.floats(-5, 80), position=positions)
def test_what_is_said_to_be_achieved_is_achieved(
    name: str, torque: float, stiffness: float, position: float
) -> None:
    joint = JOINTS[name]
    found = joint.pressures_for(torque, stiffness, position)
    for pressure in (found.agonist, found.antagonist):
        assert LOW <= pressure <= 600000.0
    at = found.pressures, position
    assert joint.torque(*at) == pytest.approx(found.torque, abs=1e-5)
    if min(joint.tensions(*at)) > 1e-3:
        assert joint.stiffness(*at) == pytest.approx(found.stiffness, abs=1e-4)
    if not found.torque_limited:
        assert found.torque == pytest.approx(torque, abs=1e-4)
    if not found.stiffness_limited:
        assert found.stiffness == pytest.approx(stiffness, abs=1e-2)


@given(torque=st.floats(-60, 60), stiffness=st.floats(0, 80), position=positions)
def test_limits_are_the_best_of_all_pressures(
    torque: float, stiffness: float, position: float
) -> None:
    joint = JOINTS["nominal"]
    found = joint.pressures_for(torque, stiffness, position)
    grid = [LOW + share * (6e5 - LOW) / 12 for share in range(13)]
    miss = abs(found.torque - torque)
    for agonist in grid:
        for antagonist in grid:
            # torque has priority
            other = abs(joint.torque((agonist, antagonist), position) - torque)
            assert miss <= other + 1e-6
    # no other pressures with the same torque come nearer to the requested stiffness
    for shift in (-2e4, -2e3, 2e3, 2e4):
        agonist = found.agonist + shift
        slope = joint.muscles[0].model.force(1.0, joint.lengths(position)[0])
        back = joint.muscles[1].model.force(1.0, joint.lengths(position)[1])
        antagonist = found.antagonist + shift * slope / back if back > 0 else math.inf
        if LOW <= agonist <= 6e5 and LOW <= antagonist <= 6e5:
            other = abs(joint.stiffness((agonist, antagonist), position) - stiffness)
            assert abs(found.stiffness - stiffness) <= other + 1e-6


def test_out_of_reach_is_flagged_torque_first() -> None:
    joint = JOINTS["nominal"]
    strong = joint.pressures_for(1000.0, 10.0, 0.2)
    assert (strong.agonist, strong.antagonist) == (600000.0, LOW)
    assert strong.torque_limited
    stiff = joint.pressures_for(2.0, 1e6, 0.2)
    assert stiff.stiffness_limited
    assert not stiff.torque_limited
    assert max(stiff.agonist, stiff.antagonist) == pytest.approx(600000.0)
    assert stiff.torque == pytest.approx(2.0)
    soft = joint.pressures_for(2.0, 0.0, 0.2)
    assert soft.stiffness < stiff.stiffness
    assert min(soft.agonist, soft.antagonist) == pytest.approx(LOW)


def test_position_outside_the_models_uses_the_edge() -> None:
    joint = JOINTS["nominal"]
    for position in (-5.0, 5.0):
        found = joint.pressures_for(1.0, 10.0, position)
        assert found.position_limited
        assert LOW <= found.agonist <= 6e5
    with pytest.raises(DomainError, match="outside"):
        joint.torque((1e5, 1e5), 5.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("which", range(3))
def test_requests_must_be_finite(bad: float, which: int) -> None:
    request = [1.0, 10.0, 0.0]
    request[which] = bad
    with pytest.raises(DomainError, match="must be finite"):
        JOINTS["nominal"].pressures_for(*request)


@pytest.mark.parametrize("name", JOINTS)
@given(agonist=pressures, antagonist=pressures, position=st.floats(-0.9, 0.9))
def test_stiffness_is_minus_the_slope_of_torque(
    name: str, agonist: float, antagonist: float, position: float
) -> None:
    joint = JOINTS[name]
    if min(joint.tensions((agonist, antagonist), position)) < 1.0:
        return
    step = 1e-5
    rise = joint.torque((agonist, antagonist), position + step) - joint.torque(
        (agonist, antagonist), position - step
    )
    stiffness = joint.stiffness((agonist, antagonist), position)
    assert stiffness == pytest.approx(-rise / (2 * step), rel=1e-4, abs=1e-3)
    assert joint.closed_stiffness((agonist, antagonist), position) > stiffness


def test_volume_slopes_match_differences() -> None:
    joint, step = JOINTS["nominal"], 1e-6
    after, before = joint.volumes(0.3 + step), joint.volumes(0.3 - step)
    for slope, more, less in zip(joint.volume_slopes(0.3), after, before, strict=True):
        assert slope == pytest.approx((more - less) / (2 * step), rel=1e-6)


def test_a_muscle_never_pushes() -> None:
    short = JointMuscle(Gaylord(0.2758, 1.856), 0.15, 0.0, 6e5)
    joint = JointStatics([short, replace_length(short, 0.225)], [0.03, -0.03])
    assert short.model.force(3e5, 0.15) < 0.0
    assert joint.tensions((3e5, 3e5), 0.0)[0] == 0.0
    assert joint.torque((3e5, 3e5), 0.0) < 0.0
    found = joint.pressures_for(5.0, 10.0, 0.0)
    assert found.torque_limited
    assert found.torque == pytest.approx(0.0, abs=1e-9)


def replace_length(muscle: JointMuscle, length: float) -> JointMuscle:
    return JointMuscle(muscle.model, length, muscle.low_pressure, muscle.high_pressure)


def test_effects_of_the_joint_count() -> None:
    joint = RIG.joint("elbow")
    rig = RIG.with_joint(replace(joint, effects={"pulley_radius": {"scale": 1.1}}))
    assert JointStatics.from_rig(rig, "elbow").radius == pytest.approx(0.033)
    nominal = JointStatics.from_rig(rig.without_effects(), "elbow")
    assert nominal.radius == 0.03


def test_least_pressure_must_be_reachable() -> None:
    with pytest.raises(DomainError, match="min_pressure = 700000 Pa"):
        JointStatics.from_rig(RIG, "elbow", min_pressure=7e5)


@pytest.mark.parametrize("effects", [BLADDER, STRETCHING, {"end_caps": {"factor": 1.1}}])
@given(pressure=pressures, length=st.floats(0.19, 0.255))
def test_effective_model_is_consistent(effects: Any, pressure: float, length: float) -> None:
    rig = with_effects(effects)
    model = JointStatics.from_rig(rig, "elbow").muscles[0].model
    step = 1e-6
    if abs(model.force(pressure, length)) < 0.1:
        return  # the slope jumps where the cable becomes slack
    rise = model.force(pressure, length + step) - model.force(pressure, length - step)
    assert model.stiffness(pressure, length) == pytest.approx(rise / (2 * step), rel=1e-3, abs=1.0)


def test_effects_by_hand() -> None:
    nominal = RIG.force_model("elbow_flexor")
    rest, length, pressure = 0.24996, 0.22, 3e5
    force = nominal.force(pressure, length)

    def effective(**effects: dict[str, float]) -> float:
        model = JointStatics.from_rig(with_effects(effects), "elbow").muscles[0].model
        return float(model.force(pressure, length))

    stretch = length - rest
    assert effective(bladder_elasticity={"linear": 400.0, "cubic": 1e6}) == pytest.approx(
        force + 400.0 * stretch + 1e6 * stretch**3
    )
    assert effective(end_caps={"factor": 1.2}) == pytest.approx(
        nominal.force(pressure, rest + 1.2 * stretch)
    )
    thread = 0.2758 / (1.0 - 5e-7 * pressure * length)
    assert effective(braid_extensibility={"compliance": 5e-7}) == pytest.approx(
        Gaylord(thread, 1.856).force(pressure, length)
    )
    pulled = effective(cable_compliance={"compliance": 2e-5})
    assert pulled == pytest.approx(nominal.force(pressure, length - 2e-5 * pulled))
    assert pulled < force


@pytest.mark.parametrize(
    ("torque", "stiffness", "position"), [(-10.272, -2.688, 1.1016), (-9.205, 1.253, 0.9474)]
)
def test_pressures_that_do_not_converge_still_give_the_torque(
    torque: float, stiffness: float, position: float
) -> None:
    """At the least stiffness of muscles that stretch, the lines jump between two points."""
    joint = JOINTS["stretching"]
    found = joint.pressures_for(torque, stiffness, position)
    assert joint.torque(found.pressures, position) == pytest.approx(torque)
    assert not found.torque_limited
    assert found.stiffness_limited
