"""Two publishers on one topic are recognised by the sources that their messages name."""

from __future__ import annotations

import pytest

from pam_ros.message_sources import MessageSources, source_of


def turns(sources: list[str], now: float = 0.0, period: float = 0.002, start: float = 0.0) -> str:
    """Who takes turns, `now` [s] after the last of these messages."""
    heard = MessageSources()
    for number, source in enumerate(sources):
        heard.hear(source, start + number * period)
    return heard.taking_turns(start + (len(sources) - 1) * period + now)


@pytest.mark.parametrize("sources", [[], ["a"], ["a"] * 9, ["a", "b"], ["", "", "b", "b"]])
def test_one_publisher_and_one_restart_are_no_turns(sources: list[str]) -> None:
    assert turns(sources) == ""


def test_two_publishers_are_named_and_forgotten_after_a_second() -> None:
    assert turns(["a", "b", "a"]) == "a and b"
    assert turns(["a", "", "", "a", "a"]) == "a and one without a name"
    assert turns(["a", "b", "a"], now=0.99) == "a and b"
    assert turns(["a", "b", "a"], now=1.01) == ""
    assert turns(["a", "b", "a"], period=1.1) == ""


def test_turns_are_noticed_whatever_the_clock_shows_and_for_one_second() -> None:
    assert turns(["a", "b", "a"], start=1e6) == "a and b"
    assert turns(["a", "b", "a"], period=0.5, now=0.5) == "a and b"


def test_an_earlier_restart_does_not_hide_turns() -> None:
    heard = MessageSources()
    for source, time in (("a", 0.0), ("b", 1.0), ("b", 20.0), ("c", 20.1), ("b", 20.2)):
        heard.hear(source, time)
    assert heard.taking_turns(20.2) == "b and c"


def test_two_nodes_of_one_name_have_two_sources() -> None:
    class Node:
        def get_fully_qualified_name(self) -> str:
            return "/arm/pam_driver"

    first, second = source_of(Node()), source_of(Node())
    assert first != second
    assert first.startswith("/arm/pam_driver#")
    assert len(first) < 30  # it is part of every message
