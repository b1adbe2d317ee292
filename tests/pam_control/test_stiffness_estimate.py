"""The stiffness of a joint that is not exactly as its rig file says."""

from __future__ import annotations

import numpy as np
import pytest

from pam_control.adaptation.stiffness_estimate import StiffnessEstimate
from pam_control.adaptation.varied_joint import JointOfRig
from pam_control.controller import Controller
from pam_control.settings import ControlSettings
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
