"""The whole loop offline: tracking, stiffness, and the laws to compare with."""

import math

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.laws.pressure_difference_pid import PressureDifferencePid
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings

SETTLE = 2.0


@pytest.fixture(scope="module")
def laws(rig):
    """The model-based law and the two it is compared with, each with its own designed gains."""
    return {
        "model": Controller(rig, ControlSettings()),
        "no feedforward": Controller(rig, ControlSettings(feedforward=False)),
        "ratio": Controller(rig, ControlSettings(), law=PressureRatioPid()),
        "difference": Controller(rig, ControlSettings(), law=PressureDifferencePid()),
    }


def tracked(loop_type, controller, motion, **options):
    """RMS error [rad] over the motion, from vented."""
    points, duration = motion
    controller.deactivate()
    loop = loop_type(controller, **options)
    loop.run(SETTLE)
    name = controller.rig.joints[0].name
    controller.references.follow([name], points, start=None, now=loop.time)
    return loop.run(duration + 0.2).rms(SETTLE)


@pytest.mark.sampled("one of the two motions", cases=1)
@pytest.mark.parametrize(("motion", "bound"), [("chirp", 0.015), ("reaching", 0.01)])
def test_tracks_better_than_without_feedforward_and_than_the_pressure_ratio(
    request, closed_loop, laws, motion, bound
):
    errors = {
        name: tracked(closed_loop, law, request.getfixturevalue(motion))
        for name, law in laws.items()
    }
    assert errors["model"] < bound / 3.0
    assert errors["no feedforward"] > 3.0 * errors["model"]
    assert errors["ratio"] > 3.0 * errors["model"]
    assert errors["difference"] < 0.5 * errors["ratio"]  # its feedforward serves it
    # Baselines that are not worth comparing with would follow nothing.
    assert max(errors.values()) < 0.2


@pytest.mark.sampled("two of the three pairs of delays", cases=2)
@pytest.mark.parametrize(("measured", "sent"), [(0.0, 0.001), (0.002, 0.002), (0.003, 0.007)])
def test_another_delay_than_told_costs_little(closed_loop, laws, chirp, measured, sent):
    options = {"measurement_delay": measured, "command_delay": sent}
    assert tracked(closed_loop, laws["model"], chirp, **options) < 0.005


def test_stiffness_is_delivered_while_the_position_holds(closed_loop, laws):
    controller = laws["model"]
    controller.deactivate()
    loop = closed_loop(controller)
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [0.3], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(1.5)
    for asked in (6.0, 10.0, 15.0, 20.0, 25.0):
        controller.set_stiffness([asked])
        moved = loop.run(1.0)
        assert np.abs(moved.error(0.0)).max() < 0.01
        delivered = moved.column(7, loop.time - 0.4)
        assert np.mean(delivered) == pytest.approx(asked, rel=0.02)


def test_a_stiffness_out_of_reach_is_cut_and_told(closed_loop, laws):
    controller = laws["model"]
    controller.deactivate()
    loop = closed_loop(controller)
    controller.set_stiffness([500.0])
    record = loop.run(16.0)
    low, high = controller.channels[0].stiffness_range
    assert controller.channels[0].telemetry.clipped == ("stiffness",)
    assert 0.0 < low < high < 500.0
    assert record.column(7, 15.5)[-1] == pytest.approx(high, rel=0.02)
    assert record.rms(15.0) < 0.01  # torque goes first: the position does not suffer
    controller.set_stiffness([14.0])


def test_takes_over_the_present_position_and_pressures(closed_loop, rig):
    """From any state the first commands neither move the joint nor jump a pressure."""
    controller = Controller(rig, ControlSettings(default_stiffness=10.0))
    loop = closed_loop(controller, pressure_noise=0.0, quantum=0.0)
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [-0.4], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    before = loop.run(2.0)
    controller.deactivate()
    after = loop.run(0.5)
    assert np.abs(after.column(2) - before.column(2)[-1]).max() < 2e-3
    for muscle in (3, 4):
        jump = np.abs(np.diff(after.column(muscle)[:20])).max()
        assert jump < 2e3
    assert np.abs(after.column(5)[:5]).max() < 0.1


def test_take_over_of_a_vented_arm_stiffens_at_the_rate_limit(closed_loop, rig):
    settings = ControlSettings(stiffness_rate=10.0)
    loop = closed_loop(Controller(rig, settings))
    record = loop.run(1.0)
    delivered, time = record.column(7), record.column(0)
    reached = np.interp([0.5, 1.0], time, delivered)
    assert reached[1] - reached[0] == pytest.approx(5.0, rel=0.1)
    assert np.abs(record.column(2)).max() < 0.02


def test_integrator_does_not_wind_up_on_what_the_muscles_cannot_do(closed_loop, rig):
    """Held by a hand far from its reference, then let go: no long overshoot."""
    from pam_control.control_step import Measurement

    controller = Controller(rig, ControlSettings())
    held = [0.0]
    pressures = [2e5, 2e5]
    controller.step(0.0, Measurement(held, pressures, 0.0, 0.0))
    points = [TrajectoryPoint(0.5, [0.9], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=0.0)
    channel = controller.channels[0]
    limit = channel.setup.integral_limit
    for cycle in range(1, 2500):
        now = 0.002 * cycle
        controller.step(now, Measurement(held, list(channel.telemetry.pressures), now, now))
        assert abs(channel.integral) <= limit
    telemetry = controller.channels[0].telemetry
    reach = controller.channels[0].models.model.pressures_for(1e6, 14.0, 0.9).torque
    gains = controller.settings.gains["elbow"].at(14.0)
    assert gains.integral * 0.9 * 5.0 > 10.0 * reach  # it had every reason to
    assert telemetry.torque < 2.0 * reach


def test_desired_pressures_move_no_faster_than_their_limit(closed_loop, rig):
    limit = 2e5
    controller = Controller(rig, ControlSettings(pressure_rate=limit))
    loop = closed_loop(controller)
    loop.run(3.0)
    points = [TrajectoryPoint(0.01, [0.5])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    seen = [controller.channels[0].telemetry.pressures]
    clipped = set()

    def watch(_: float) -> None:
        seen.append(controller.channels[0].telemetry.pressures)
        clipped.update(controller.channels[0].telemetry.clipped)

    loop.run(0.5, watch)
    steps = np.abs(np.diff(np.array(seen), axis=0)).max()
    assert steps <= limit * 0.002 * 1.001
    assert steps > limit * 0.002 * 0.5
    assert "pressure_rate" in clipped


def test_commands_and_desired_pressures_stay_in_range_under_wild_references(closed_loop, rig):
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(1.0)
    for target in (1.0, -1.0, 0.9, -0.9):
        points = [TrajectoryPoint(0.002, [target])]
        controller.references.follow(["elbow"], points, start=None, now=loop.time)
        record = loop.run(0.3)
        for muscle in (5, 6):
            assert np.abs(record.column(muscle)).max() <= 1.0
        desired = controller.channels[0].telemetry.pressures
        assert all(0.0 <= pressure <= 6.0e5 for pressure in desired)


def test_two_joints_are_controlled_each_on_its_own(closed_loop, two_joint_rig):
    controller = Controller(two_joint_rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [0.4], [0.0], [0.0])]
    controller.references.follow(["shoulder"], points, start=None, now=loop.time)
    controller.set_stiffness([10.0, 18.0])
    record = loop.run(2.5)
    assert record.column(2)[-1] == pytest.approx(0.4, abs=2e-3)
    elbow = loop.plants[1].output
    assert elbow["position"] == pytest.approx(0.0, abs=2e-3)
    model = controller.channels[1].models.model
    pressures = elbow["agonist.pressure"], elbow["antagonist.pressure"]
    assert model.stiffness(pressures, elbow["position"]) == pytest.approx(18.0, rel=0.02)


def test_refuses_to_act_on_what_is_old_missing_or_not_a_number(rig):
    from pam_control.control_step import Measurement

    controller = Controller(rig, ControlSettings())
    good = ([0.1], [1e5, 1e5])
    assert controller.step(1.0, Measurement(*good, 1.0, 1.0)).commands is not None
    cases = [
        (Measurement(*good, 0.9, 1.0), "positions are 100 ms old"),
        (Measurement(*good, 1.0, 0.9), "pressures are 100 ms old"),
        (Measurement([math.nan], [1e5, 1e5], 1.0, 1.0), "position of elbow"),
        (Measurement([0.1], [1e5, math.nan], 1.0, 1.0), "pressure of elbow_extensor"),
        (Measurement([], [1e5, 1e5], 1.0, 1.0), "no position measured yet"),
    ]
    for measurement, said in cases:
        output = controller.step(1.0, measurement)
        assert output.commands is None
        assert said in output.reason
        assert not controller.active
