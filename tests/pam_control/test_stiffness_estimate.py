"""The stiffness of a joint that is not exactly as its rig file says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pam_control.adaptation.stiffness_estimate import StiffnessEstimate
from pam_control.adaptation.varied_joint import JointOfRig
from pam_control.controller import Controller
from pam_control.settings import ControlSettings
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import rig_from_parameters
from pam_model.robot import compose
from pam_model.views.inverse_dynamics import InverseDynamics

OFF = {"joint.pulley_radius": 1.02, "agonist.turns": 0.98, "antagonist.turns": 0.985}


def played(closed_loop, rig, reaching, factors=None, effects=None):
    """A controller after one motion on a rig with other dimensions, and its loop."""
    points, duration = reaching
    controller = Controller(rig, ControlSettings(stiffness_corrected=True))
    loop = closed_loop(controller)
    plant = loop.plants[0]
    changed = {name: factor * plant.parameters[name] for name, factor in (factors or {}).items()}
    plant.change({**changed, **(effects or {})})
    loop.run(1.5)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(duration)
    return controller, loop


def true_joint(rig, factors) -> JointStatics:
    """The joint with these dimensions, from its own rig file."""
    tree = rig.to_parameters()
    flexor, extensor = tree["elbow"]["muscles"]
    owners = {"joint": "elbow", "agonist": flexor, "antagonist": extensor}
    for name, factor in factors.items():
        owner, key = name.split(".")
        tree[owners[owner]][key] *= factor

    return JointStatics.from_rig(rig_from_parameters(tree), "elbow")


def test_no_measured_position_ends_the_estimate(rig):
    """Models with changed dimensions end at other positions than that of the rig file."""
    joint = rig.joints[0]
    model = JointStatics.from_rig(rig, joint.name)
    dynamics = InverseDynamics.from_joint(compose(rig).joints[0])
    estimate = StiffnessEstimate(JointOfRig(rig, joint), model, dynamics, 30.0)
    pressures = (2e5, 1e5)
    for _ in range(30):
        for position in (*model.position_range, 0.1, 0.0):
            estimate.learn(0.02, pressures, position)
            assert np.isfinite(estimate.at(pressures, position).value)


def test_the_stiffness_of_a_rig_that_is_two_per_cent_off_is_learnt_in_one_motion(
    closed_loop, rig, reaching
):
    controller, loop = played(closed_loop, rig, reaching, OFF)
    channel, truth = controller.channels[0], true_joint(rig, OFF)
    output = loop.plants[0].output
    state = (output["agonist.pressure"], output["antagonist.pressure"]), output["position"]
    true = truth.stiffness(state[0], state[1])
    wrong = channel.models.model.stiffness(state[0], state[1])
    found = channel.law_state.estimates.stiffness.at(*state)
    assert abs(wrong / true - 1.0) > 0.03
    assert found.learnt
    assert found.value == pytest.approx(true, rel=0.025)
    assert found.low < true < found.high
    assert found.high - found.low < 0.08 * true
    # and the joint has the stiffness that was commanded
    loop.run(2.0)
    output = loop.plants[0].output
    has = truth.stiffness(
        (output["agonist.pressure"], output["antagonist.pressure"]), output["position"]
    )
    assert has == pytest.approx(controller.stiffness_commands[0], rel=0.05)


def test_what_the_dimensions_do_not_explain_leaves_the_stiffness_of_the_model(
    closed_loop, rig, reaching
):
    friction = {"coulomb_friction.torque": 0.6}
    controller, loop = played(closed_loop, rig, reaching, effects=friction)
    channel, output = controller.channels[0], loop.plants[0].output
    state = (output["agonist.pressure"], output["antagonist.pressure"]), output["position"]
    found = channel.law_state.estimates.stiffness.at(*state)
    assert not found.learnt
    assert found.value == pytest.approx(channel.models.model.stiffness(state[0], state[1]))
    assert found.high / found.value > 1.03  # the interval of the tolerance
    assert channel.law_state.correction.factor == 1.0


def test_a_rig_that_is_its_rig_file_keeps_its_stiffness(closed_loop, rig, reaching):
    controller, loop = played(closed_loop, rig, reaching)
    assert controller.channels[0].law_state.correction.factor == pytest.approx(1.0, abs=5e-3)
    assert np.isfinite(loop.plants[0].output["position"])


class Joint:
    """A joint of any number of muscles: a pulley that all share, and their lengths."""

    tolerance = 0.03

    def __init__(self, rig, shares):
        muscle = compose(rig).muscles[0]
        self.one = JointMuscle(muscle.force_model, muscle.neutral_length, 0.0, 6e5)
        self.shares, self.radius = shares, rig.joints[0].pulley_radius
        self.numbers = ["radius", *(f"length {k}" for k in range(len(shares)))]

    def changed(self, changes):
        yield self.with_changes(changes)

    def with_changes(self, changes):
        radius = (1.0 + changes[0]) * self.radius
        muscles = [
            replace(self.one, neutral_length=(1.0 + change) * self.one.neutral_length)
            for change in changes[1:]
        ]
        return JointStatics(muscles, [share * radius for share in self.shares])

    def places(self, dynamics):
        raise NotImplementedError


@pytest.mark.parametrize("shares", [(1.0,), (1.0, -1.0), (1.0, 0.8, -0.9), (1.0, 0.8, -0.9, -0.6)])
def test_a_joint_of_any_number_of_muscles_has_its_stiffness_learnt(rig, shares):
    """The motion and the pressures are given; what holds the joint to the motion is known."""
    joint, dynamics = Joint(rig, shares), InverseDynamics.from_joint(compose(rig).joints[0])
    nothing = [0.0] * len(joint.numbers)
    model, truth = joint.with_changes(nothing), joint.with_changes([0.02, *[-0.005] * len(shares)])
    estimate = StiffnessEstimate(joint, model, dynamics, 30.0)
    for cycle in range(600):
        t = 0.02 * cycle
        position = 0.3 * np.sin(2.0 * t) + 0.1 * np.sin(3.1 * t)
        speed = 0.6 * np.cos(2.0 * t) + 0.31 * np.cos(3.1 * t)
        acceleration = -1.2 * np.sin(2.0 * t) - 0.961 * np.sin(3.1 * t)
        pressures = [2.5e5 + 1e5 * np.sin((1.0 + 0.3 * k) * t + k) for k in range(len(shares))]
        needed = dynamics.torque(position, speed, acceleration)
        estimate.learn(0.02, pressures, position, needed - truth.torque(pressures, position))
    found, true = estimate.at(pressures, 0.1), truth.stiffness(pressures, 0.1)
    assert found.learnt
    assert abs(model.stiffness(pressures, 0.1) / true - 1.0) > 0.02
    assert found.value == pytest.approx(true, rel=0.01)
    assert found.low < true < found.high
    assert estimate.factor(pressures, 0.1, 1.0) == pytest.approx(
        true / model.stiffness(pressures, 0.1), rel=0.01
    )


class Counting:
    """A joint of a rig file that counts the parts of its work in which something is built."""

    def __init__(self, joint):
        self.joint, self.parts = joint, 0
        self.numbers, self.tolerance, self.places = joint.numbers, joint.tolerance, joint.places

    def changed(self, changes):
        for part in self.joint.changed(changes):
            self.parts += 1
            yield part


def estimates_of(rig, period, cycles):
    """An estimate after cycles [s] of a joint that is 2 % off, and its parts in each cycle."""
    joint = rig.joints[0]
    model = JointStatics.from_rig(rig, joint.name)
    dynamics = InverseDynamics.from_joint(compose(rig).joints[0])
    counting = Counting(JointOfRig(rig, joint))
    *_, truth = JointOfRig(rig, joint).changed([0.03, 0.01, -0.03, 0.005, 0.0, 0.02, -0.005])
    # with a small torque even small errors are no noise, so that the derivatives are taken anew
    estimate = StiffnessEstimate(counting, model, dynamics, 0.5)
    parts = []
    for cycle in range(cycles):
        t, before = period * cycle, counting.parts
        position = 0.3 * np.sin(2.0 * t) + 0.1 * np.sin(3.1 * t)
        speed = 0.6 * np.cos(2.0 * t) + 0.31 * np.cos(3.1 * t)
        acceleration = -1.2 * np.sin(2.0 * t) - 0.961 * np.sin(3.1 * t)
        pressures = [2.5e5 + 1e5 * np.sin((1.0 + 0.3 * k) * t + k) for k in range(2)]
        needed = dynamics.torque(position, speed, acceleration)
        estimate.go_on()
        estimate.rebuild(period)
        estimate.learn(period, pressures, position, needed - truth.torque(pressures, position))
        parts.append(counting.parts - before)
    return estimate, parts, truth.stiffness((2.5e5, 2e5), 0.1)


def test_a_cycle_does_a_part_of_the_work_and_the_whole_is_the_same(rig):
    """At 500 Hz the work is spread over many cycles; at 50 Hz each sample is learnt at once."""
    spread, parts, true = estimates_of(rig, 0.002, 4000)
    at_once, *_ = estimates_of(rig, 0.02, 400)
    assert max(parts) == 1
    assert sum(parts) > 60  # the derivatives were taken anew, more than once
    for each in (spread, at_once):
        found = each.at((2.5e5, 2e5), 0.1)
        assert found.learnt
        assert found.value == pytest.approx(true, rel=0.01)
        assert found.low < true < found.high


def test_a_sample_is_learnt_before_the_next_one_in_loops_of_any_rate(rig):
    """Where nobody asks for parts in between, the next sample finishes the last one."""
    joint = rig.joints[0]
    model = JointStatics.from_rig(rig, joint.name)
    dynamics = InverseDynamics.from_joint(compose(rig).joints[0])
    found = []
    for helps in (False, True):
        estimate = StiffnessEstimate(JointOfRig(rig, joint), model, dynamics, 30.0)
        for cycle in range(100):
            if helps:
                for _ in range(20):
                    estimate.go_on()
            position = 0.3 * np.sin(0.1 * cycle)
            estimate.learn(0.02, (2e5, 1.5e5 + 1e3 * cycle), position)
        estimate.go_on()
        found.append(estimate.at((2e5, 2e5), 0.1))
    assert found[0] == found[1]
