"""A joint of one to four muscles: the same inverse finds the pressures for torque and stiffness."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from pam_model.errors import DomainError
from pam_model.joints.affine_inverse import affine_pressures
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.joints.muscle_inverse import (
    L_PRESSURE,
    L_RATIO,
    N_LINE,
    line_of,
    muscle_pressures,
    write_line,
)
from pam_model.plant.compiled import for_kernel
from pam_model.plant.layout import C_MUSCLES, N_MUSCLE_CONSTANTS
from pam_model.rig import load_rig
from pam_model.robot import compose
from pam_model.views.joint_numbers import joint_numbers
from pam_model.views.joint_rows import muscles_torques, pressures_for

RIG = load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")
STRETCHING = {
    "bladder_elasticity": {"linear": 500.0, "cubic": 1e6},
    "braid_extensibility": {"compliance": 5e-7},
    "cable_compliance": {"compliance": 1e-5},
}
LOW, HIGH = 2e4, 6e5
RADIUS = RIG.joints[0].pulley_radius
SHARES = {
    "one": (1.0,),
    "one the other way": (-1.0,),
    "two": (1.0, -1.0),
    "two of one side": (1.0, 0.8),
    "two unequal": (1.0, -0.7),
    "two that are equal against one": (1.0, 1.0, -1.0),
    "three": (-0.9, 0.6, 1.0),
    "four": (1.0, 0.7, -1.0, -0.6),
}
"""Arms over the radius of the elbow's pulley."""


def joint_of(shares: tuple[float, ...], effects: dict[str, dict[str, float]]) -> JointStatics:
    rig = RIG
    for muscle in RIG.muscles:
        rig = rig.with_muscle(replace(muscle, effects=effects))
    muscle = compose(rig).muscles[0]
    one = JointMuscle(muscle.force_model, muscle.neutral_length, LOW, HIGH)
    return JointStatics([one] * len(shares), [share * RADIUS for share in shares])


AFFINE = {name: joint_of(shares, {}) for name, shares in SHARES.items()}
OTHERS = {name: joint_of(shares, STRETCHING) for name, shares in SHARES.items()}
ALL = [*AFFINE.values(), *OTHERS.values()]
positions = st.floats(-0.8, 0.8)


@pytest.mark.parametrize("joint", ALL, ids=[*SHARES, *(f"{name}, stretching" for name in SHARES)])
@given(data=st.data(), position=positions)
def test_torque_and_stiffness_that_can_be_reached_are_reached(
    joint: JointStatics, data: st.DataObject, position: float
) -> None:
    drawn = [data.draw(st.floats(LOW, HIGH)) for _ in joint.muscles]
    assume(min(joint.tensions(drawn, position)) > 1.0)
    torque, stiffness = joint.torque(drawn, position), joint.stiffness(drawn, position)
    found = joint.pressures_for(torque, stiffness, position)
    assert all(LOW <= pressure <= HIGH for pressure in found.pressures)
    assert joint.torque(found.pressures, position) == pytest.approx(torque, abs=1e-4)
    assert not (found.torque_limited or found.position_limited)
    if min(joint.tensions(found.pressures, position)) > 0.0:
        # equal muscles whose stiffness bends with pressure are not moved apart to its very end
        is_against = len(joint.muscles) == 2 and joint.arms[0] * joint.arms[1] < 0.0
        is_exact = joint in AFFINE.values() or len(joint.muscles) == 1 or is_against
        near = {"abs": 1e-2} if is_exact else {"rel": 0.05}
        has = joint.stiffness(found.pressures, position)
        assert has == pytest.approx(stiffness, **near)
        assert found.stiffness == pytest.approx(has, abs=1e-9)
        assert not (is_exact and found.stiffness_limited)
    squares = sum(pressure**2 for pressure in drawn)
    if joint in AFFINE.values():
        assert sum(pressure**2 for pressure in found.pressures) <= squares * (1.0 + 1e-6)


@pytest.mark.parametrize("name", SHARES)
@given(torque=st.floats(-150, 150), stiffness=st.floats(-10, 200), position=positions)
def test_what_is_out_of_reach_is_the_nearest_that_is_not(
    name: str, torque: float, stiffness: float, position: float
) -> None:
    joint = AFFINE[name]
    found = joint.pressures_for(torque, stiffness, position)
    models = [muscle.affine_model for muscle in joint.muscles]
    lengths, arms = joint.lengths(position), np.array(joint.arms)
    pulls = np.array([m.coefficients(x) for m, x in zip(models, lengths, strict=True) if m])
    slopes = np.array([m.coefficient_slopes(x) for m, x in zip(models, lengths, strict=True) if m])
    assume((LOW * pulls[:, 0] + pulls[:, 1] > 0.0).all() and (pulls[:, 0] > 1e-6).all())
    ends = [arms * (pressure * pulls[:, 0] + pulls[:, 1]) for pressure in (LOW, HIGH)]
    low, high = float(np.minimum(*ends).sum()), float(np.maximum(*ends).sum())
    nearest = min(max(torque, low), high)
    assert joint.torque(found.pressures, position) == pytest.approx(
        nearest, abs=1e-9 * (1.0 + high - low)
    )
    assert found.torque == pytest.approx(nearest, abs=1e-9 * (1.0 + high - low))
    assert found.torque_limited == (abs(nearest - torque) > 1e-6 * (1.0 + sum(abs(ends[1]))))
    # the range of the stiffness at this torque, by a solver of others
    offset, unit = float(arms @ pulls[:, 1]), 1e5
    reach = []
    for sign in (1.0, -1.0):
        answer = linprog(
            sign * unit * arms**2 * slopes[:, 0],
            A_eq=[unit * arms * pulls[:, 0]],
            b_eq=[found.torque - offset],
            bounds=[(LOW / unit * (1 - 1e-9), HIGH / unit * (1 + 1e-9))] * len(arms),
        )
        assume(answer.status == 0)
        reach.append(float(arms**2 @ (slopes[:, 0] * unit * answer.x + slopes[:, 1])))
    wanted = min(max(stiffness, reach[0]), reach[1])
    assert found.stiffness == pytest.approx(wanted, abs=1e-5 * (1.0 + abs(wanted)))
    assert joint.stiffness(found.pressures, position) == pytest.approx(found.stiffness, abs=1e-9)


@given(torque=st.floats(-60, 60), stiffness=st.floats(-5, 80), position=positions)
def test_two_muscles_against_each_other_have_their_exact_inverse_to_the_bit(
    torque: float, stiffness: float, position: float
) -> None:
    joint = AFFINE["two"]
    rows = rows_at(joint, position)
    pair = affine_pressures(line_of(rows[0], 0), line_of(rows[1], 0), RADIUS, torque, stiffness)
    found = joint.pressures_for(torque, stiffness, position)
    assert (found.pressures, found.torque, found.stiffness) == (pair[:2], *pair[2:4])
    # and the general inverse says the same of two arms that are hardly different
    rows[1][L_RATIO] = -1.0 - 1e-15
    muscle_pressures(rows, 0, RADIUS, torque, stiffness)
    assert [row[L_PRESSURE] for row in rows] == pytest.approx(pair[:2], abs=1e-3)


def rows_at(joint: JointStatics, position: float) -> list[list[float]]:
    rows = [[0.0] * N_LINE for _ in joint.muscles]
    joint_lines = joint.lines(position)
    for row, line, ratio in zip(rows, joint_lines, joint.ratios, strict=True):
        write_line(row, 0, line, ratio)
    return rows


@given(position=positions, share=st.floats(0.05, 0.95))
def test_equal_muscles_share_a_torque_equally(position: float, share: float) -> None:
    joint = AFFINE["two that are equal against one"]
    torque = joint.torque([share * HIGH, share * HIGH, LOW], position)
    first, second, _ = joint.pressures_for(torque, 0.0, position).pressures
    assert first == pytest.approx(second, abs=1e-3)


@pytest.mark.parametrize("name", SHARES)
def test_a_small_change_of_the_torque_changes_the_pressures_little(name: str) -> None:
    """Where torque and stiffness are in reach, no muscle takes the load of another one at once."""
    joint = AFFINE[name]
    before: Any = None
    for share in np.linspace(0.0, 1.0, 400):
        pressures = [(0.3 + 0.3 * share) * HIGH] + [0.45 * HIGH] * (len(joint.muscles) - 1)
        torque, stiffness = joint.torque(pressures, 0.1), joint.stiffness(pressures, 0.1)
        found = np.array(joint.pressures_for(torque, stiffness, 0.1).pressures)
        if before is not None:
            assert np.abs(found - before).max() < 5e3
        before = found


@pytest.mark.parametrize("arm", [0.03, -0.03])
def test_one_muscle_holds_a_spring_and_a_weight(arm: float) -> None:
    """The muscle gives what spring and weight take; its stiffness is what comes with it."""
    muscle = AFFINE["one"].muscles[0]
    joint = JointStatics([muscle], [arm])
    for position in (-0.4, 0.0, 0.4):
        hold = math.copysign(8.0, arm) + 4.0 * position + 1.5 * math.sin(position)
        found = joint.pressures_for(hold, 1e3, position)
        assert joint.torque(found.pressures, position) == pytest.approx(hold)
        assert not found.torque_limited
        assert found.stiffness_limited
        # and no torque against its pull
        slack = joint.pressures_for(-hold, 0.0, position)
        assert slack.torque_limited
        assert slack.pressures == (LOW,)


@pytest.mark.parametrize("name", SHARES)
@pytest.mark.parametrize(("torque", "stiffness"), [(2.0, 10.0), (-30.0, 0.0), (0.5, 200.0)])
def test_rows_of_a_controller_give_the_same(name: str, torque: float, stiffness: float) -> None:
    joint, position = AFFINE[name], 0.2
    robot = compose(RIG)
    one = joint_numbers(robot)[0]
    block = one[C_MUSCLES : C_MUSCLES + N_MUSCLE_CONSTANTS]
    c = for_kernel(np.concatenate([one[:C_MUSCLES], *[block] * len(joint.muscles)]))
    rows = np.zeros((len(joint.muscles), 3 + N_LINE))
    found = joint.pressures_for(torque, stiffness, position)
    rows[:, 0], rows[:, 1] = LOW, HIGH
    rows[:, 3 + L_RATIO] = np.array(joint.arms) / RADIUS
    w, no_table = for_kernel(rows), for_kernel(np.zeros((1, 1)))
    reached = pressures_for(c, no_table, w, 3, 0, 1, position, torque, stiffness)
    assert reached[:2] == pytest.approx((found.torque, found.stiffness), rel=1e-9, abs=1e-9)
    assert reached[2:] == (found.torque_limited, found.stiffness_limited)
    assert [row[3 + L_PRESSURE] for row in w] == pytest.approx(found.pressures, rel=1e-7)
    for row, pressure in zip(w, found.pressures, strict=True):
        row[2] = pressure
    model, without_signs = muscles_torques(c, no_table, w, 3, 2, position)
    assert model == pytest.approx(joint.torque(found.pressures, position), rel=1e-12)
    of_one = zip(joint.arms, joint.tensions(found.pressures, position), strict=True)
    grip = sum(abs(arm * pull) for arm, pull in of_one)
    assert joint.grip(found.pressures, position) == pytest.approx(grip, rel=1e-12)
    assert without_signs == pytest.approx(grip, rel=1e-12)


def test_a_joint_without_muscles_or_arms_is_refused() -> None:
    muscle = AFFINE["one"].muscles[0]
    with pytest.raises(DomainError, match="0 arms for 0 muscles"):
        JointStatics([], [])
    with pytest.raises(DomainError, match="1 arms for 2 muscles"):
        JointStatics([muscle, muscle], [0.03])
    for bad in (0.0, math.nan, math.inf):
        with pytest.raises(DomainError, match="must be a finite number other than 0"):
            JointStatics([muscle], [bad])
