"""A parameter of one node of a process, also in a namespace, where rcl would drop it silently."""

from __future__ import annotations

from pam_ros.node_arguments import arguments_by_node

NODES = ("pam_driver", "pam_controller")


def test_what_is_for_one_node_goes_to_that_node() -> None:
    words = ["--ros-args", "-p", "pam_driver:bus.channel:=can1", "-r", "__ns:=/left"]
    words += ["-p", "x:=1", "--param", "pam_controller:loop.rate:=250.0"]
    words += ["-p", "pam_driver:rate:=250.0"]
    rest, own = arguments_by_node(words, NODES)
    assert rest == ["--ros-args", "-r", "__ns:=/left", "-p", "x:=1"]
    assert own == {
        "pam_driver": ["--ros-args", "-p", "bus.channel:=can1", "-p", "rate:=250.0"],
        "pam_controller": ["--ros-args", "-p", "loop.rate:=250.0"],
    }


def test_a_value_with_a_colon_and_other_nodes_are_left_alone() -> None:
    words = ["--ros-args", "-p", "name:=pam_driver:x", "-p", "other:name:=1", "-r", "a:=b", "-p"]
    assert arguments_by_node(words, NODES) == (words, {"pam_driver": [], "pam_controller": []})


def test_a_value_may_hold_whatever_it_likes() -> None:
    _, own = arguments_by_node(["-p", "pam_driver:bus.options:=a:=b:c"], NODES)
    assert own["pam_driver"] == ["--ros-args", "-p", "bus.options:=a:=b:c"]
