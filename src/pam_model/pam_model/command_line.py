"""The command line of every tool of the suite.

A `Tool` parses a command line and runs one of its `Command`s. This module gives all of them
the same options, messages and exit codes (docs/exit_codes.md):

- `--json` prints the result as one JSON document on standard output, and nothing else there;
- `--check` ends with exit code 1 if the result is bad news;
- a user's mistake ends with one line on standard error and exit code 2;
- `--version` prints the name and the version of the package;
- progress is shown on standard error, and only if it is a terminal.

Only the standard library is imported here. A command imports its modules when it runs, so that
`--help` and a mistake in the command line are reported at once.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import gc
import io
import json
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final, Protocol

from pam_model.errors import PamError
from pam_model.linear_algebra_threads import use_one_thread
from pam_model.names import unknown
from pam_model.program_signals import (
    STOPPED,
    Terminated,
    end_at_signals,
    exit_code,
    interruptible,
)
from pam_ros.errors import ParameterError
from pam_ros.missing_packages import what_to_install
from pam_ros.program_name import PROGRAM
from pam_ros.version import version_line

DONE: Final = 0
BAD_NEWS: Final = 1
"""The result is bad news, and the option --check was given."""
MISTAKE: Final = 2
"""A user's mistake: an option, a file or a number that cannot be used."""
INTERRUPTED: Final = exit_code(signal.SIGINT)
"""Interrupted with Ctrl-C."""
TERMINATED: Final = exit_code(signal.SIGTERM)
"""Ended by SIGTERM."""
NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a disk, quota or file that is full; they name no file."""
READER_GONE: Final = 141
"""Standard output was closed, for example by `head`: 128 plus the number of the signal."""

ABOUT: Final = frozenset({"-h", "--help", "--version"})
"""Ask about a program instead of starting it."""

Arguments = argparse.Namespace
Parser = argparse.ArgumentParser


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a command."""

    # the result for --json: mappings, sequences, numbers, text, paths, dataclasses, arrays
    document: object
    # reasons why --check ends with exit code 1, one line each; empty for good news
    bad_news: Sequence[str] = ()
    # whether the user ended the command early; the result is that up to this moment
    interrupted: bool = False


@dataclass(frozen=True, slots=True)
class Command:
    """One command of a tool."""

    name: str  # what the user types
    summary: str  # what it does, one line
    declare: Callable[[Parser], None]  # adds the arguments to a parser; imports nothing heavy
    run: Callable[[Arguments], Outcome]  # does the work; a PamError reports a mistake of the user
    bad_news: str = ""  # condition on which --check ends with exit code 1; empty without --check
    # command lines for the help text; the word `pam` at their beginning is shown as `PROGRAM`
    examples: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class NodeCommand:
    """A command that is a ROS node: the arguments after its name are those of the node."""

    # name, summary: as of a `Command`
    name: str
    summary: str
    # imports the node and runs it with its arguments; None stands for those of the process
    run: Callable[[Sequence[str] | None], int]
    # imports what the node's `--help` prints (pam_ros.node_help), and nothing heavy
    usage: Callable[[], _Usage]

    def start(self, arguments: Sequence[str] | None = None) -> int:
        """Import and run the node; return its exit code. A package that is missing is one line.

        Parameters
        ----------
        arguments : sequence of str, optional
            Arguments of the node; those of the process by default.
        """
        if arguments is None:  # the program itself, not a caller within another one
            end_at_signals()
        words = sys.argv[1:] if arguments is None else arguments
        if not ABOUT.isdisjoint(words):  # before ROS is imported, which takes a second
            return self.usage().answer(words) or DONE
        gc.disable()  # what is imported and made stays; the node's main loop enables it
        try:
            return self.run(arguments)
        except ModuleNotFoundError as error:
            return _code_after(error)
        finally:
            gc.enable()


class _Usage(Protocol):
    """What tells how a node is used."""

    def answer(self, arguments: Sequence[str]) -> int | None:
        """Print what was asked for, and return the exit code."""


class _OneLineParser(argparse.ArgumentParser):
    """A parser that reports a mistake in one line and accepts no abbreviated options."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            **options,
            allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    def error(self, message: str) -> Any:
        self.exit(MISTAKE, f"error: {message}; see {self.prog} --help\n")


class _VersionAction(argparse.Action):
    """Prints the version and ends; looks it up only then, because that takes time."""

    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="print the version and exit")

    def __call__(self, parser: Parser, *_: object) -> None:
        """Take part in argparse's protocol."""
        print(version_line(parser.prog))
        parser.exit()


@dataclass(frozen=True, slots=True)
class Tool:
    """The commands of one package, which the user runs as `pam NAME COMMAND`."""

    name: str  # what the user types; empty for the program `pam` itself, whose commands are tools
    summary: str  # purpose of the tool, one line
    commands: Sequence[Command | NodeCommand | Tool]  # all commands of the tool
    default: str = ""  # the command that runs if none is named
    # former commands, each with the command line that replaces it
    moved: Mapping[str, str] = field(default_factory=dict)

    @property
    def program(self) -> str:
        """What the user types before the command."""
        return f"{PROGRAM} {self.name}".rstrip()

    def run(self, arguments: Sequence[str] | None = None) -> int:
        """Parse a command line, run the command that it names, and return the exit code.

        Parameters
        ----------
        arguments : sequence of str, optional
            Words of the command line; those of the process by default.
        """
        if "_ARGCOMPLETE" in os.environ:
            _complete(self)
        if arguments is None:  # the program itself, not a caller within another one
            end_at_signals()
            use_one_thread()
        given = list(sys.argv[1:] if arguments is None else arguments)
        by_name = {command.name: command for command in self.commands}
        if self.default and (not given or (given[0][:1] == "-" and given[0] not in ABOUT)):
            given.insert(0, self.default)
        if given and given[0] in self.moved:
            print(f"error: {given[0]} is now: {self.moved[given[0]]}", file=sys.stderr)
            return MISTAKE
        if given and given[0] in by_name:
            command = by_name[given[0]]
            if isinstance(command, Command):
                return run_command(command, f"{self.program} {command.name}", given[1:])
            if isinstance(command, NodeCommand):
                return command.start(given[1:])
            return command.run(given[1:])
        parser = _OneLineParser(prog=self.program, description=f"{self.summary}.")
        parser.add_argument("--version", action=_VersionAction)
        listed = parser.add_subparsers(metavar="COMMAND", required=True, title="commands")
        for command in self.commands:
            note = " (the default)" if command.name == self.default else ""
            listed.add_parser(command.name, help=command.summary + note)
        try:
            if given and not given[0].startswith("-"):
                parser.error(unknown("command", given[0], by_name))
            parser.parse_args(given)
        except SystemExit as end:
            return _code_of(end)
        raise AssertionError("a command that is listed has run")


def _complete(tool: Tool) -> None:
    """Answer the shell that asks how a command line continues, and end the process.

    The shell asks by an environment variable, for which it needs argcomplete itself.
    """
    import argcomplete  # noqa: PLC0415

    parser = _OneLineParser(prog=tool.program)
    _declare_all(tool, parser)
    argcomplete.autocomplete(parser)


def _declare_all(tool: Tool, parser: Parser) -> None:
    """Give a parser all commands of a tool with their options."""
    parser.add_argument("--version", action=_VersionAction)
    listed = parser.add_subparsers()
    for command in tool.commands:
        one = listed.add_parser(command.name, help=command.summary)
        if isinstance(command, Command):
            _declare(command, one)
        elif isinstance(command, Tool):
            _declare_all(command, one)


def _declare(command: Command, parser: Parser) -> None:
    """Give a parser the options of a command, and those that all commands have."""
    command.declare(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="print the result as one JSON document, and nothing else, on standard output",
    )
    parser.add_argument("--version", action=_VersionAction)
    if command.bad_news:
        words = command.bad_news.replace("%", "%%")  # argparse formats help texts
        parser.add_argument("--check", action="store_true", help=f"exit code {BAD_NEWS} {words}")


def run_command(command: Command, program: str, arguments: Sequence[str] | None = None) -> int:
    """Parse the arguments of one command, run it, and return the exit code.

    Parameters
    ----------
    program : str
        What the user types before the arguments.
    arguments : sequence of str, optional
        Words of the command line; those of the process by default.
    """
    if arguments is None:  # the program itself, not a caller within another one
        end_at_signals()
        use_one_thread()
    parser = _OneLineParser(
        prog=program,
        description=f"{command.summary[0].upper()}{command.summary[1:]}.",
        epilog="".join(
            ["examples:\n", *(f"  {_typed(line)}\n" for line in command.examples)]
            if command.examples
            else []
        ),
    )
    _declare(command, parser)
    try:
        chosen = parser.parse_args(arguments)
    except SystemExit as end:
        return _code_of(end)
    try:
        with interruptible():
            outcome = _carry_out(command, chosen)
    except (PamError, ParameterError, OSError, ModuleNotFoundError, KeyboardInterrupt) as error:
        return _code_after(error)
    if outcome.interrupted:
        return INTERRUPTED
    if outcome.bad_news and command.bad_news and chosen.check:
        for line in outcome.bad_news:
            print(f"check failed: {line}", file=sys.stderr)
        return BAD_NEWS
    return DONE


def _typed(line: str) -> str:
    """An example as it is typed here."""
    return f"{PROGRAM}{line[3:]}" if line.startswith("pam ") else line


def _carry_out(command: Command, chosen: Arguments) -> Outcome:
    """Run a command and print its result as text or as JSON."""
    # with --json, standard output holds the document alone
    hidden = contextlib.redirect_stdout(io.StringIO())
    with hidden if chosen.json else contextlib.nullcontext():
        outcome = command.run(chosen)
    if chosen.json:
        print(json.dumps(plain(outcome.document), indent=1, allow_nan=False))
    sys.stdout.flush()
    return outcome


def _code_after(error: BaseException) -> int:
    """Report a user's mistake in one line, or an interruption; return the exit code."""
    code, text = MISTAKE, f"error: {error}"
    if isinstance(error, KeyboardInterrupt):
        code = TERMINATED if isinstance(error, Terminated) else INTERRUPTED
        text = STOPPED
    elif isinstance(error, ModuleNotFoundError):
        told = what_to_install(error)
        if told is None:
            raise error
        text = f"error: {told}"
    elif isinstance(error, BrokenPipeError):
        # prevents the interpreter from flushing into the closed pipe at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    elif isinstance(error, OSError) and error.errno in NO_ROOM:
        text = (
            f"error: {error.strerror}: a file could not be written, and what there is of it is "
            "incomplete; free space on the disk, or name another folder"
        )
    elif isinstance(error, OSError):
        if error.filename is None:  # the user did not name this file
            raise error
        text = f"error: {error.filename}: {error.strerror}"
    print(text, file=sys.stderr)
    return code


def _code_of(end: SystemExit) -> int:
    """The exit code of argparse after the help text or a mistake."""
    return end.code if isinstance(end.code, int) else MISTAKE if end.code else DONE


def plain(value: Any) -> Any:
    """Convert a value to JSON types; a number that is not finite becomes null.

    Parameters
    ----------
    value : object
        Mappings, sequences, dataclasses, paths, numbers, arrays or text; they may be nested.
    """
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    elif hasattr(value, "_asdict"):  # a named tuple
        value = value._asdict()
    elif hasattr(value, "tolist"):  # a NumPy array or number
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path | Enum) else value


class Progress:
    """Progress of the work, shown if standard error is a terminal."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar

    def show(self, done: float, text: str = "") -> None:
        """Show the finished amount, in the unit of the total, and the present work."""
        if text:
            self._bar.set_description_str(text, refresh=False)
        self._bar.update(max(0.0, done - self._bar.n))


@contextlib.contextmanager
def progress(total: float, text: str = "", *, wanted: bool = True) -> Iterator[Progress]:
    """A progress bar during the work; nothing if standard error is not a terminal.

    Parameters
    ----------
    total : float
        Amount of work, which `Progress.show` gets at the end.
    text : str, optional
        The present work.
    wanted : bool, optional
        False: show nothing, even on a terminal.
    """
    from tqdm import tqdm  # type: ignore[import-untyped]  # noqa: PLC0415

    form = "{desc} {percentage:3.0f} %|{bar}| {elapsed}<{remaining}"
    # tqdm takes None as "not without a terminal"
    with tqdm(total=total, desc=text, disable=None if wanted else True, bar_format=form) as bar:
        yield Progress(bar)


def no_arguments(_: Parser) -> None:
    """Declare nothing, for a command without arguments of its own."""
