"""Foreign text in messages: short, quoted, on one line."""

from __future__ import annotations

from pam_ros.foreign_text import all_shown, shown


def test_a_short_text_is_quoted_whole():
    assert shown("elbow") == "'elbow'"


def test_a_long_text_is_cut_and_its_length_is_stated():
    text = shown("x" * 100_000)
    assert len(text) < 100
    assert "100000 characters" in text


def test_control_characters_do_not_reach_a_terminal():
    assert "\n" not in shown("a\nb") and "\x1b" not in shown("\x1b[2J")


def test_a_long_list_is_cut_and_the_rest_is_counted():
    assert all_shown(["a", "b"]) == "'a', 'b'"
    text = all_shown(str(number) for number in range(1000))
    assert text.endswith("and 992 more") and len(text) < 200
