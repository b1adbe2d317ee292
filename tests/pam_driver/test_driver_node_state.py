"""What the driver node reports of its state, inside the process of a test."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.lifecycle import TransitionCallbackReturn
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from pam_driver.boards.pam_board.codec import (
    BoardCodec,
)
from pam_driver.safety.people_inputs import FULL_SPEED
from pam_ros.driver_state import (
    driver_state_message,
    permits_full_speed,
    reason_against_commands,
)

from .node_inside import Inside

pytestmark = pytest.mark.system


def test_the_lamp_is_green_only_while_every_muscle_is_measured_empty(
    inside: Inside, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = inside.node
    told: list[str] = []
    monkeypatch.setattr(
        node._reported._topic,
        "_lamps",
        SimpleNamespace(publish=lambda message: told.append(message.data)),
    )
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    node._watch()
    assert told[-1] == "yellow", "ready: a command moves the joint"
    node._calls.on_vent(Trigger.Request(), Trigger.Response())
    inside.answer(inside.healthy)
    node._watch()
    assert told[-1] == "green"
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert told[-1] == "off"
    assert all(one != other for one, other in itertools.pairwise(told)), "on change only"


def test_every_change_of_state_is_published_with_its_reason(
    inside: Inside, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The controller follows this topic, so it must be right and early."""
    node = inside.node
    told: list[str] = []
    monkeypatch.setattr(
        node._reported._topic,
        "_states",
        SimpleNamespace(publish=lambda message: told.append(message.message)),
    )
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    node._calls.on_vent(Trigger.Request(), Trigger.Response())
    node._watch()
    node._watch()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    # how soon the muscles are measured empty depends on the I/O thread
    settled = [text.replace("venting:", "vented:") for text in told]
    assert [text for text, _ in itertools.groupby(settled)] == [
        "vented: configured, not activated yet",
        "ready",
        "vented: a call of ~/vent",
        "unconfigured",
    ]


def test_clear_faults_says_of_an_active_driver_that_it_is_active(inside: Inside) -> None:
    node = inside.node
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    answer = node._calls.on_clear_faults(Trigger.Request(), Trigger.Response())
    assert (answer.success, answer.message) == (True, "ready")
    node._watch()
    assert node._reported._topic.text == "ready", "not: faults cleared, not activated yet"
    node._calls.on_vent(Trigger.Request(), Trigger.Response())
    inside.answer(inside.healthy)
    answer = node._calls.on_clear_faults(Trigger.Request(), Trigger.Response())
    assert answer.message.endswith("; activate to move")


def test_the_state_tells_the_controller_whether_full_speed_is_permitted(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec
) -> None:
    wanted = ("people.full_speed_topic", "true"), ("people.deadline", 5.0)
    inside = Inside(monkeypatch, codec, *wanted)
    try:
        node = inside.node
        assert node.count_subscribers("/pam_driver/full_speed_permitted") == 1
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        assert "at reduced speed" in node._reported._topic.text
        node._inputs.on_people(FULL_SPEED, Bool(data=True))
        node._reported.publish(node._driver)
        assert "at reduced speed" not in node._reported._topic.text
        node._inputs.on_people(FULL_SPEED, Bool(data=False))
        node._reported.publish(node._driver)
        assert "at reduced speed" in node._reported._topic.text
    finally:
        inside.close()


@pytest.mark.parametrize("reduced", [True, False])
def test_a_state_without_a_word_about_the_speed_permits_no_full_speed(reduced: bool) -> None:
    told = driver_state_message("pam_driver", "active", "", reduced=reduced)
    assert permits_full_speed(told) is not reduced
    assert reason_against_commands(told) == ""
    assert not permits_full_speed(DiagnosticStatus())
