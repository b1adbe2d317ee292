"""Laws that let a person or a planner move the joint: float, impedance, torque.

The outside torque is that of a force on the limb, -T cos q, which the plant gets as a turn of its
gravity. The controller does not know it.
"""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import numpy as np
import pytest

from pam_control.command_intake import CommandIntake
from pam_control.controller import Controller
from pam_control.laws.gravity_compensation import GravityCompensation
from pam_control.laws.impedance import Impedance
from pam_control.laws.position_stiffness import PositionStiffness
from pam_control.laws.registry import laws
from pam_control.laws.torque import END_ZONE, Torque
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.settings import ControlSettings

QUIET = ControlSettings()
FLOAT = GravityCompensation(hold_torque=0.2)


@pytest.fixture(scope="module")
def make(rig):
    """A controller of a law."""

    def create(law, rig=rig):
        return Controller(rig, QUIET, law=law)

    return create


def push(loop, torque: float) -> None:
    """Let an outside torque -torque cos(q) act from now on."""
    weight = loop.controller.rig.joints[0].gravity_torque
    changes = {
        "joint.gravity_torque": math.hypot(weight, torque),
        "joint.gravity_angle": -math.atan2(torque, weight),
    }
    loop.plants[0].change(changes)


def go(loop, position: float) -> None:
    references = loop.controller.references
    references.follow(["elbow"], [TrajectoryPoint(1.0, [position])], start=None, now=loop.time)
    loop.run(2.0)


@pytest.mark.sampled("each stiffness and each position of rest")
@pytest.mark.parametrize("stiffness", [8.0, 14.0])
@pytest.mark.parametrize("rest", [-0.4, 0.3])
def test_impedance_deflects_by_torque_over_stiffness(make, closed_loop, stiffness, rest):
    loop = closed_loop(make(Impedance()))
    loop.run(0.5)
    loop.controller.set_stiffness([stiffness])
    go(loop, rest)
    before = loop.run(0.2).column(2).mean()
    assert before == pytest.approx(rest, abs=2e-3)
    push(loop, 1.5)
    loop.run(2.0)
    after = loop.run(0.2).column(2).mean()
    assert stiffness * (before - after) == pytest.approx(1.5 * math.cos(after), rel=0.05)
    push(loop, 0.0)
    loop.run(2.0)
    assert loop.run(0.2).column(2).mean() == pytest.approx(before, abs=2e-3)
    assert not loop.controller.guard.softened


def test_a_stiffness_that_the_muscles_cannot_have_is_completed_by_feedback(make, closed_loop, rig):
    for muscle in rig.muscles:
        rig = rig.with_muscle(replace(muscle, max_pressure=3e5))
    controller = make(Impedance(), rig=rig)
    loop = closed_loop(controller)
    loop.run(0.5)
    controller.set_stiffness([20.0])
    loop.run(2.5)
    telemetry = controller.channels[0].telemetry
    assert telemetry.stiffness_reached < 17.0  # more than the muscles have at this pressure
    before = loop.run(0.2).column(2).mean()
    push(loop, 2.0)
    loop.run(2.0)
    after = loop.run(0.2).column(2).mean()
    assert 20.0 * (before - after) == pytest.approx(2.0 * math.cos(after), rel=0.07)


def test_a_joint_that_is_pushed_away_for_long_is_no_fault_of_the_impedance(make, closed_loop, rig):
    narrow = rig.with_joint(replace(rig.joint("elbow"), max_tracking_error=0.05))
    loop = closed_loop(make(Impedance(), rig=narrow))
    loop.run(1.0)
    push(loop, 2.0)
    error = loop.run(1.5).error(2.0)  # an output of none would fail in the loop
    assert np.abs(error).max() > 0.1
    stiff = closed_loop(make(PositionStiffness(), rig=narrow))
    stiff.run(1.0)
    assert not stiff.controller.channels[0].telemetry.law.yields


@pytest.mark.parametrize("delay", [0.0, 0.015])
def test_impedance_and_float_are_stable_with_the_delay_of_the_design(make, closed_loop, delay):
    for law in (Impedance(), FLOAT):
        loop = closed_loop(make(law), command_delay=0.003 + delay)
        loop.run(1.0)
        push(loop, 2.0)
        loop.run(1.0)
        push(loop, 0.0)
        loop.run(1.5)
        assert np.ptp(loop.run(0.5).column(2)) < 2e-3
        assert not loop.controller.guard.softened


def test_float_stays_where_it_is_put_and_bears_the_weight_of_the_arm(make, closed_loop):
    loop = closed_loop(make(FLOAT))
    loop.run(0.5)
    push(loop, -1.2)  # a hand lifts the arm
    loop.run(1.0)
    push(loop, 0.0)  # and lets go
    loop.run(0.5)
    put = loop.run(0.1).column(2).mean()
    assert put > 0.2
    rows = loop.run(4.0)
    assert np.abs(rows.column(2) - put).max() < 0.01


def test_float_holds_an_unknown_load_up_to_the_hold_torque_and_sinks_slowly_above(
    make, closed_loop
):
    law = GravityCompensation(hold_torque=0.4, speed_limit=0.2)
    loop = closed_loop(make(law))
    loop.run(1.0)
    push(loop, 0.3)
    loop.run(0.5)
    held = loop.run(3.0).column(2)
    assert np.ptp(held) < 0.01
    push(loop, 3.0)  # far above the hold torque
    loop.run(0.6)
    position = loop.run(1.0).column(2)
    speed = np.abs(np.diff(position[::25])) / 0.05
    assert position[-1] < held[-1] - 0.1
    assert speed.max() < 0.25
    lower = loop.controller.rig.joints[0].position_limits[0]
    loop.run(6.0)
    assert loop.run(0.1).column(2).min() > lower - 0.25  # the rest angle stays in the range


def test_float_refuses_references_and_a_stop_holds_until_a_new_activation(make, closed_loop):
    controller = make(FLOAT)
    loop = closed_loop(controller)
    loop.run(1.0)
    assert "moved by hand" in controller.reason_against_motion()
    controller.stop(loop.time)
    push(loop, -1.0)
    loop.run(1.0)
    push(loop, 0.0)
    loop.run(1.5)
    assert abs(loop.run(0.1).column(2).mean()) < 0.02  # it came back
    controller.drop_commands()
    loop.run(0.5)
    push(loop, -1.0)
    loop.run(1.0)
    push(loop, 0.0)
    loop.run(1.0)
    assert loop.run(0.1).column(2).mean() > 0.1


def torque_loop(make, closed_loop):
    controller = make(Torque())
    loop = closed_loop(controller)
    loop.run(1.0)
    return controller, loop


HORIZONTAL = pytest.mark.long("the inverted joint, which falls, is harder to balance")


@pytest.mark.parametrize(
    "weight", [pytest.param(0.0, marks=HORIZONTAL), -4.9], ids=["horizontal", "inverted"]
)
def test_a_planner_may_balance_a_joint_that_its_weight_does_not_hold(closed_loop, rig, weight):
    """The law refused every joint without a restoring weight, although only its angle drifts."""
    other = rig.with_joint(replace(rig.joints[0], gravity_torque=weight))
    controller = Controller(other, QUIET, law=Torque())
    loop = closed_loop(controller)
    loop.run(2.0)

    def planner(time: float) -> None:
        position, velocity, _ = controller.channels[0].motion
        spring = 10.0 * (0.3 * math.sin(6.0 * time) - position)
        held = weight * math.sin(position)
        controller.set_torques([held + spring - 0.3 * velocity], time)

    swing = loop.run(4.0, planner).column(2, 4.0)
    assert 0.2 < swing.max() < 0.5
    assert -0.5 < swing.min() < -0.2
    assert np.abs(np.diff(swing, 2)).max() < 1e-4  # rad in a cycle: no ripple


def test_the_torque_of_the_muscles_is_what_was_asked_for(make, closed_loop):
    """Within 0.15 N m RMS, by the true pressures and the true angle, while the joint swings."""
    controller, loop = torque_loop(make, closed_loop)
    weight = controller.rig.joints[0].gravity_torque
    asked, given = [], []
    model = controller.channels[0].models.model

    def planner(time: float) -> None:
        position = loop.plants[0].output["position"]
        wanted = weight * math.sin(position) + 0.8 * math.sin(3.0 * time) - 1.0 * position
        controller.set_torques([wanted], time)

    begin = loop.time
    rows = loop.run(4.0, planner)
    for row in rows.rows:
        if row[0] > begin + 0.5:
            asked.append(weight * math.sin(row[2]) + 0.8 * math.sin(3.0 * row[0]) - 1.0 * row[2])
            given.append(model.torque(row[3:5], row[2]))
    error = np.array(given) - np.array(asked)
    assert np.ptp(rows.column(2)) > 0.2  # it moves
    assert np.sqrt(np.mean(error**2)) < 0.15


def test_no_torque_makes_the_joint_faster_than_its_limit_or_throws_it_out_of_its_range(
    make, closed_loop
):
    controller, loop = torque_loop(make, closed_loop)
    joint = controller.rig.joints[0]
    peak = 0.0
    for torque in (30.0, -30.0, 30.0):
        rows = loop.run(0.8, lambda time, t=torque: controller.set_torques([t], time))
        peak = max(peak, float(np.abs(np.diff(rows.column(2)) / 0.002).max()))
        assert rows.column(2).max() < joint.position_limits[1] + 0.02
        assert rows.column(2).min() > joint.position_limits[0] - 0.02
    assert peak < joint.max_velocity
    assert END_ZONE > 0.0


def test_torques_that_cease_or_a_stop_end_in_a_held_joint(make, closed_loop):
    for ends_by_stop in (False, True):
        controller, loop = torque_loop(make, closed_loop)
        loop.run(0.4, lambda time, c=controller: c.set_torques([2.5], time))
        if ends_by_stop:
            controller.stop(loop.time)
        loop.run(1.0)
        rows = loop.run(1.0)
        assert np.ptp(rows.column(2)) < 3e-3
        assert np.abs(rows.error(0.0)).max() < 5e-3
        assert rows.column(2).mean() > 0.1  # where it was, not where it came from


def test_torques_from_before_a_vent_do_not_move_the_joint_afterwards(make, closed_loop):
    controller, loop = torque_loop(make, closed_loop)
    loop.run(0.2, lambda time: controller.set_torques([1.0], time))
    controller.drop_commands()
    here = loop.run(0.1).column(2)[-1]
    loop.run(0.9)
    rows = loop.run(0.5).column(2)
    assert np.abs(rows - here).max() < 0.06  # it coasts, and is held
    assert np.ptp(rows) < 2e-3


@pytest.mark.parametrize(
    ("values", "said"),
    [([1.0, 2.0], "2 values for 1 joints"), ([math.nan], "elbow at nan N m")],
)
def test_bad_torques_are_refused_by_name(make, values, said):
    with pytest.raises(CommandError, match=said):
        make(Torque()).set_torques(values, 0.0)


def test_other_laws_refuse_torques_and_an_inactive_controller_refuses_them_too(make):
    told = []
    for name, reason in (("model_based", ""), ("torque", "the driver is vented")):
        controller = make(laws()[name]())

        intake = CommandIntake(
            controller, threading.Lock(), lambda: 0.0, lambda reason=reason: reason, told.append
        )
        intake.torque([1.0])
        assert intake.rejected == 1
    assert "only law torque takes torques" in told[0]
    assert "the driver is vented" in told[1]
