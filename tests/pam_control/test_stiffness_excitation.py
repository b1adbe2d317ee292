"""The small motion by which the stiffness of a joint that rests is estimated."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.controller_parameters import parameter_table, settings_from
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.sine_burst import sine_burst
from pam_control.references.spline import JointReference
from pam_control.references.stiffness_excitation import StiffnessExcitation
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.errors import PamError

LIMITS = {"elbow": (-1.0, 1.0), "wrist": (-0.5, 0.5)}


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.05, 1.5), (0.1, 0.3)])
def test_the_motion_begins_and_ends_at_rest_and_its_derivatives_are_those_of_its_positions(
    amplitude, frequency
):
    points = sine_burst(0.3, amplitude, frequency)
    times = np.array([0.0] + [point.time_from_start for point in points])
    position = np.array([0.3] + [point.positions[0] for point in points])
    velocity = np.array([0.0] + [point.velocities[0] for point in points])
    acceleration = np.array([0.0] + [point.accelerations[0] for point in points])
    assert points[-1].positions == [0.3]
    assert velocity[-1] == acceleration[-1] == 0.0
    assert times[-1] >= 4.0
    assert np.abs(position - 0.3).max() == pytest.approx(amplitude, rel=0.01)
    slope = np.gradient(position, times)[1:-1]
    bend = np.gradient(velocity, times)[1:-1]
    assert np.abs(slope - velocity[1:-1]).max() < 0.05 * np.abs(velocity).max()
    assert np.abs(bend - acceleration[1:-1]).max() < 0.1 * np.abs(acceleration).max()


def found(test, references, stiffness, begin, end, amplitude=0.05):
    """When and which joints are tested between two times [s], asked four times a second."""
    tested = []
    for now in np.arange(begin, end, 0.25).tolist():
        references.advance(now)
        due = test.due(now, stiffness, amplitude)
        if due is not None:
            tested.append((now, *due))
            points = [
                TrajectoryPoint(p.time_from_start, p.positions, p.velocities, p.accelerations)
                for p in sine_burst(due[1], amplitude, 1.5)
            ]
            references.follow([due[0]], points, start=None, now=now)
    return tested


def test_each_joint_is_tested_once_at_rest_one_after_the_other():
    references = ReferenceGenerator(LIMITS)
    references.hold({"elbow": 0.2, "wrist": 0.1})
    tested = found(StiffnessExcitation(references), references, [14.0, 14.0], 0.0, 30.0)
    assert [name for _, name, _ in tested] == ["elbow", "wrist"]
    (first, _, where), (second, _, _) = tested
    assert where == pytest.approx(0.2)
    assert 2.0 <= first < 3.0
    assert second - first >= 4.0  # when the motion of the other joint is over


def test_another_position_or_stiffness_is_tested_anew_and_no_room_is_no_test():
    references = ReferenceGenerator({"elbow": (-1.0, 1.0)})
    references.hold({"elbow": 0.2})
    test = StiffnessExcitation(references)
    assert len(found(test, references, [14.0], 0.0, 20.0)) == 1
    assert len(found(test, references, [17.0], 20.0, 40.0)) == 1
    references.follow(["elbow"], [TrajectoryPoint(1.0, [0.6])], start=None, now=40.0)
    assert [q for _, _, q in found(test, references, [17.0], 40.25, 60.0)] == [pytest.approx(0.6)]
    references.follow(["elbow"], [TrajectoryPoint(1.0, [0.98])], start=None, now=60.0)
    assert found(test, references, [17.0], 60.25, 80.0) == []


def test_a_pause_in_a_trajectory_or_a_stream_that_stands_still_is_no_rest():
    references = ReferenceGenerator({"elbow": (-1.0, 1.0)})
    references.hold({"elbow": 0.0})
    test = StiffnessExcitation(references)
    points = [TrajectoryPoint(t, [q], [0.0]) for t, q in ((1.0, 0.3), (9.0, 0.3), (10.0, 0.0))]
    references.follow(["elbow"], points, start=None, now=0.0)
    assert found(test, references, [14.0], 0.0, 10.0) == []
    times = itertools.takewhile(lambda t: t < 30.0, itertools.count(20.0, 0.1))
    for now in times:
        references.stream(["elbow"], [0.0], now=now)
        references.advance(now)
        assert test.due(now, [14.0], 0.05) is None


def test_the_stiffness_of_a_joint_that_only_rests_is_learnt_by_the_test(closed_loop, rig):
    controller = Controller(rig, ControlSettings(safe_delay=0.01))
    loop = closed_loop(controller)
    loop.plants[0].change({"joint.pulley_radius": 1.02 * rig.joints[0].pulley_radius})
    loop.run(1.0)
    channel = controller.channels[0]
    where = channel.telemetry.pressures, channel.motion.position
    assert not channel.law_state.estimates.stiffness.at(*where).learnt
    controller.references.follow(["elbow"], sine_burst(0.0, 0.05, 1.5), start=None, now=loop.time)
    before = channel.law_state.estimates.stiffness.at(*where)
    loop.run(4.2)
    after = channel.law_state.estimates.stiffness.at(*where)
    assert after.learnt
    assert after.high - after.low < 0.8 * (before.high - before.low)
    assert isinstance(controller.references.sample("elbow", loop.time), JointReference)


@pytest.mark.parametrize("change", [{"law": "torque"}, {"adaptation.enabled": False}])
def test_a_test_that_nothing_learns_from_is_refused(change):
    values = {each.name: each.default for each in parameter_table(["elbow"])}
    asked = {**values, "stiffness_test.amplitude": 0.05}
    settings_from(asked, ["elbow"])
    with pytest.raises(PamError, match=r"stiffness_test\.amplitude: must be 0 unless"):
        settings_from({**asked, **change}, ["elbow"])
