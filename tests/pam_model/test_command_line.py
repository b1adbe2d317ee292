"""The common command line of all tools: exit codes, --json, --check, progress, mistakes."""

from __future__ import annotations

import io
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pam_model import argument_types as types
from pam_model.command_line import (
    BAD_NEWS,
    DONE,
    INTERRUPTED,
    MISTAKE,
    Command,
    NodeCommand,
    Outcome,
    Parser,
    Tool,
    progress,
)
from pam_model.errors import PamError


@dataclass
class Result:
    place: Path
    value: float


class Usage:
    """Stands in for what a node's `--help` prints."""

    def answer(self, arguments) -> int:
        print("how to watch")
        return DONE


def ends(run, *arguments: str, **options) -> int:
    """Exit code of a tool with one command, `act`, that has the option `--times`."""

    def declare(parser: Parser) -> None:
        parser.add_argument("--times", type=types.count(1, 9), default=1)

    command = Command("act", "act a little", declare, run, bad_news="if it fails")
    node = NodeCommand("watch", "a node", len, Usage)
    return Tool("tool", "A tool", [command, node], **options).run(arguments)


def acting(given) -> Outcome:
    print("text for people")
    return Outcome({"times": given.times, "nan": math.nan, "array": np.array([1.0, math.inf])})


def failing(given) -> Outcome:
    return Outcome({}, ["it is too warm"])


def test_json_is_one_document_and_nothing_else_on_standard_output(capsys):
    assert ends(acting, "act", "--json", "--times", "3") == DONE
    told = capsys.readouterr()
    assert json.loads(told.out) == {"times": 3, "nan": None, "array": [1.0, None]}
    assert told.err == ""
    assert ends(acting, "act") == DONE
    assert capsys.readouterr().out == "text for people\n"


def test_bad_news_are_an_exit_code_only_where_they_are_asked_for(capsys):
    assert ends(failing, "act") == DONE
    assert ends(failing, "act", "--check") == BAD_NEWS
    assert capsys.readouterr().err == "check failed: it is too warm\n"
    assert ends(acting, "act", "--check") == DONE


def test_an_interrupted_command_ends_as_a_shell_expects(capsys):
    def stopped(given):
        raise KeyboardInterrupt

    assert ends(stopped, "act") == INTERRUPTED
    assert capsys.readouterr().err == "stopped\n"
    assert ends(lambda given: Outcome({}, ["bad"], interrupted=True), "act") == INTERRUPTED


def test_a_mistake_is_one_line_and_a_fault_of_ours_keeps_its_traceback(capsys, tmp_path):
    def refusing(given):
        raise PamError("expected something else")

    def opening(given):
        (tmp_path / "nothing").read_text()
        raise AssertionError

    def broken(given):
        raise OSError("no file has to do with it")

    for run in (refusing, opening):
        assert ends(run, "act") == MISTAKE
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("error: ")
    assert "nothing" in line
    with pytest.raises(OSError, match="no file"):
        ends(broken, "act")


def test_a_full_disk_is_one_line_that_says_what_is_left(capsys):
    def writing(given):
        Path("/dev/full").write_text("a report")
        raise AssertionError

    assert ends(writing, "act") == MISTAKE
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: No space left on device")
    assert "incomplete" in line


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "COMMAND"),
        (("acts",), "unknown command 'acts'; did you mean act? Known: act, watch"),
        (("--times",), "COMMAND"),
        (("act", "--tim", "3"), "--tim"),
        (("act", "--times", "0"), "0: expected a whole number from 1 to 9"),
        (("act", "--times", "many"), "many"),
        (("act", "more"), "more"),
        (("gone",), "gone is now: other tool gone"),
    ],
)
def test_a_wrong_command_line_is_told_in_one_line(arguments, told, capsys):
    assert ends(acting, *arguments, moved={"gone": "other tool gone"}) == MISTAKE
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("error: ")
    assert told in line
    assert captured.out == ""


def test_the_default_command_runs_where_none_is_named(capsys):
    assert ends(acting, "--times", "2", default="act") == DONE
    assert ends(acting, default="act") == DONE
    assert ends(acting, "--help", default="act") == DONE
    assert "act a little (the default)" in capsys.readouterr().out


def test_a_node_gets_its_words_as_they_are():
    assert ends(acting, "watch", "--ros-args", "-p", "times:=0") == 3


def test_help_names_every_option_with_an_example(capsys):
    assert ends(acting, "act", "--help") == DONE
    told = capsys.readouterr().out
    for word in ("Act a little.", "--times", "--json", "exit code 1 if it fails"):
        assert word in told


def test_progress_is_quiet_but_on_a_terminal(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    def shown(stream, **options):
        monkeypatch.setattr(sys, "stderr", stream)
        with progress(3.0, "working", **options) as bar:
            for done in range(4):
                bar.show(done, f"part {done}")
        return stream.getvalue()

    assert shown(io.StringIO()) == ""
    assert shown(Terminal(), wanted=False) == ""
    assert "part" in shown(Terminal())


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (types.count(), ["1", "7"], ["0", "-1", "1.5", "x", ""]),
        (types.count(0), ["0"], ["-1"]),
        (types.number("s", above=0.0, most=5.0), ["0.1", "5"], ["0", "-1", "6", "nan", "inf"]),
        (types.number("s", least=0.0), ["0", "1 s"], ["-1e-9", "1 m"]),
        (types.named_number, ["a.b=1e-3"], ["a", "a=", "a=b"]),
    ],
)
def test_numbers_out_of_bounds_are_refused(kind, good, bad):
    for text in good:
        kind(text)
    for text in bad:
        with pytest.raises(types.argparse.ArgumentTypeError, match="expected"):
            kind(text)


def test_files_and_folders_are_told_apart_before_any_work(tmp_path):
    file, missing = tmp_path / "file", tmp_path / "missing"
    file.write_text("")
    for kind, good, bad in (
        (types.input_path, [file, tmp_path], [missing]),
        (types.input_file, [file], [missing, tmp_path]),
        (types.input_folder, [tmp_path], [missing, file]),
        (types.output_file, [file, missing, missing / "a"], [tmp_path, file / "a"]),
        (types.new_file, [missing, missing / "a"], [file, tmp_path, file / "a"]),
        (types.output_folder, [tmp_path, missing, missing / "a"], [file, file / "a"]),
    ):
        for path in good:
            assert kind(str(path)) == path
        for path in bad:
            with pytest.raises(types.argparse.ArgumentTypeError, match=str(path)):
                kind(str(path))


def test_what_is_no_json_becomes_plain(capsys):
    made = Outcome([Result(Path("a"), math.inf), (1, np.float64(2.0)), {3: np.int64(4)}])
    assert ends(lambda given: made, "act", "--json") == DONE
    told = json.loads(capsys.readouterr().out)
    assert told == [{"place": "a", "value": None}, [1, 2.0], {"3": 4}]
