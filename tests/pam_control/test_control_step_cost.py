"""What a control step costs, counted in calls, because times depend on the machine."""

import cProfile
import math
import pstats
import sys
from functools import partial
from statistics import median, quantiles

from pam_control.adaptation import varied_joint
from pam_control.adaptation.normal_equations import SEEN, UNSOLVED
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.settings import ControlSettings
from pam_model.joints.joint_statics import JointStatics

PERIOD = 0.002
CYCLES = 250
MOST = 650
"""Calls in one cycle of one joint on average, those of built-in functions included. There were 523
when this was written, and 809 before the cycle was made cheaper."""


def steps_of_a_stream(rig, cycles, states=None):
    """Steps while all joints follow a stream, each a function without arguments.

    To `states` are added those of the fits of the valves.
    """
    controller, now = Controller(rig, ControlSettings()), 1.0
    flows = [loop.adaptation for channel in controller.channels for loop in channel.loops]
    if states is not None:
        states += [fit.rows[1] for flow in flows for fit in (flow._fit, flow.tube.fit)]
    joints = len(rig.joints)
    for cycle in range(cycles):
        now += PERIOD
        position = 0.3 * math.sin(2.0 * now)
        if cycle % 5 == 0 and controller.active:
            aim = 0.3 * math.sin(2.0 * (now + 0.01))
            controller.references.stream(rig.joint_names, [aim] * joints, (), now=now)
        stamp, pressures = now - PERIOD, [2e5 + 1e4 * position] * 2 * joints
        seen = Measurement([position] * joints, pressures, stamp, stamp)
        yield partial(controller.step, now, seen)


def test_a_cycle_of_one_joint_makes_few_calls(rig):
    """With all that is learnt, while the joint follows a stream."""
    profile = cProfile.Profile()
    for cycle, step in enumerate(steps_of_a_stream(rig, CYCLES + 50)):
        if cycle >= 50:
            profile.enable()
        output = step()
        profile.disable()
        assert output.commands is not None, output.reason
    calls = pstats.Stats(profile).total_calls
    assert calls / CYCLES < MOST


def test_no_cycle_builds_more_than_one_model(rig, monkeypatch):
    """The derivatives of the stiffness need eight models: 1.5 ms of a cycle of 2 ms, in one go."""
    built = []
    steps = steps_of_a_stream(rig, 1000)
    next(steps)()  # makes the controller and its models
    monkeypatch.setattr(
        varied_joint,
        "JointStatics",
        lambda *given, **named: built.append(1) or JointStatics(*given, **named),
    )
    counts = []
    for step in steps:
        before = len(built)
        assert step().commands is not None
        counts.append(len(built) - before)
    assert sum(counts) >= 8  # the derivatives were taken anew at least once
    assert max(counts) == 1


def test_no_cycle_does_much_more_than_the_others(rig):
    """What takes long is done in parts: 99 of 100 cycles make at most twice the usual calls."""
    calls, counts = 0, []

    def count(frame, event, argument):
        nonlocal calls
        calls += event in ("call", "c_call")

    for step in steps_of_a_stream(rig, 1500):
        calls = 0
        sys.setprofile(count)
        try:
            step()
        finally:
            sys.setprofile(None)
        counts.append(calls)
    counts = counts[50:]
    usual = median(counts)
    assert quantiles(counts, n=100)[98] < 2.2 * usual
    assert max(counts) < 3.0 * usual


def test_joints_take_turns_with_what_they_learn(two_joint_rig):
    """Two joints and four valves solve ten fits; in one cycle, seven joints would need 5 ms."""
    states = []
    steps, counts = steps_of_a_stream(two_joint_rig, 500, states), []
    for step in steps:
        before = [float(state[SEEN]) for state in states]
        assert step().commands is not None
        sampled = zip(states, before, strict=True)
        solved = [s for s, seen in sampled if s[SEEN] != seen and s[UNSOLVED] == 0.0]
        counts.append(len(solved))
    assert len(states) == 8
    assert sum(counts) > 50
    assert max(counts) <= 3  # a valve solves two, for its flow and for a tube
