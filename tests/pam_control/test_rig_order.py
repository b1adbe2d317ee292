"""How the controller reads messages that do not name every joint of the rig."""

from __future__ import annotations

import math

import pytest

from pam_control.references.trajectory import CommandError
from pam_control.rig_order import in_order

JOINTS = ["shoulder", "elbow"]


def test_values_come_in_the_order_of_the_rig_and_foreign_names_are_ignored():
    names = ["gripper", "elbow", "shoulder"]
    assert in_order(names, [9.0, 2.0, 1.0], JOINTS, "position") == [1.0, 2.0]


def test_a_joint_that_is_left_out_is_not_measured():
    found = in_order(["elbow"], [2.0], JOINTS, "position")
    assert found == pytest.approx([math.nan, 2.0], nan_ok=True)
    assert all(math.isnan(value) for value in in_order([], [], JOINTS, "position"))


def test_joint_states_of_a_gripper_say_nothing_about_the_arm():
    assert in_order(["gripper"], [0.4], JOINTS, "position") is None


def test_a_message_with_fields_of_different_length_is_rejected():
    with pytest.raises(CommandError, match="1 position values for 2 names"):
        in_order(["elbow", "shoulder"], [1.0], JOINTS, "position")


def test_of_a_joint_that_is_named_twice_no_value_is_chosen():
    with pytest.raises(CommandError, match="position: a name is given twice"):
        in_order(["elbow", "shoulder", "elbow"], [1.0, 2.0, -1.0], JOINTS, "position")
