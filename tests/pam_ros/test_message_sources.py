"""Two publishers on one topic are recognised by the sources that their messages name."""

from __future__ import annotations

import pytest

from pam_ros.message_sources import MessageSources


def turns(sources: list[str], now: float = 0.0, period: float = 0.002) -> str:
    """Who takes turns, `now` [s] after the last of these messages."""
    heard = MessageSources()
    for number, source in enumerate(sources):
        heard.hear(source, number * period)
    return heard.taking_turns((len(sources) - 1) * period + now)


@pytest.mark.parametrize("sources", [[], ["a"], ["a"] * 9, ["a", "b"], ["", "", "b", "b"]])
def test_one_publisher_and_one_restart_are_no_turns(sources: list[str]) -> None:
    assert turns(sources) == ""


def test_two_publishers_are_named_and_forgotten_after_a_second() -> None:
    assert turns(["a", "b", "a"]) == "a and b"
    assert turns(["a", "", "", "a", "a"]) == "a and one without a name"
    assert turns(["a", "b", "a"], now=0.99) == "a and b"
    assert turns(["a", "b", "a"], now=1.01) == ""
    assert turns(["a", "b", "a"], period=1.1) == ""
