"""The one way in which every tool of the suite builds its command line.

A tool is a list of `Command`s that `run_program` parses and runs. This module gives all of them
the same options, messages and exit codes (docs/exit_codes.md):

- `--json` prints the result as one JSON document on standard output, and nothing else there;
- `--check` ends with exit code 1 where the result is bad news;
- a user's mistake ends in one line on standard error and exit code 2;
- progress is shown on standard error, and only if that is a terminal.

Only the standard library is imported here. A command imports what it needs when it runs, so that
`--help` and a mistake in the command line are answered at once.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final

from pam_model.argument_types import input_file
from pam_model.errors import PamError

DONE: Final = 0
BAD_NEWS: Final = 1
"""Of a result, where the option --check asks for it."""
MISTAKE: Final = 2
"""Of the user: an option, a file or a number that cannot be used."""
INTERRUPTED: Final = 130
"""By Ctrl-C: 128 and the number of the signal."""
READER_GONE: Final = 141
"""Standard output was closed, as `head` does: 128 and the number of the signal."""

Arguments = argparse.Namespace
Parser = argparse.ArgumentParser


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command has found out.

    Attributes
    ----------
    document : object
        The result for --json: mappings, sequences, numbers, text, paths, dataclasses, arrays.
    bad_news : sequence of str
        Why --check ends with exit code 1, one line each; empty for good news.
    interrupted : bool
        Whether the user ended the command early, which it has survived to tell its result.
    """

    document: object
    bad_news: Sequence[str] = ()
    interrupted: bool = False


@dataclass(frozen=True, slots=True)
class Command:
    """One command of a tool.

    Attributes
    ----------
    name : str
        What the user types.
    summary : str
        What it does, one line.
    declare : callable
        Adds the arguments to a parser; imports nothing heavy.
    run : callable
        Does the work; a PamError is a mistake of the user.
    bad_news : str
        When --check ends with exit code 1; empty for a command without --check.
    examples : sequence of str
        Command lines for the help text.
    """

    name: str
    summary: str
    declare: Callable[[Parser], None]
    run: Callable[[Arguments], Outcome]
    bad_news: str = ""
    examples: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class NodeCommand:
    """A command that is a ROS node: the words after its name are the node's own."""

    name: str
    summary: str
    run: Callable[[Sequence[str]], int]


class _OneLineParser(argparse.ArgumentParser):
    """Tells a mistake in one line, and takes no abbreviated options."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            **options,
            allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    def error(self, message: str) -> Any:
        self.exit(MISTAKE, f"error: {message}; see {self.prog} --help\n")


def run_program(
    program: str,
    description: str,
    commands: Sequence[Command | NodeCommand],
    arguments: Sequence[str] | None = None,
    *,
    default: str = "",
    moved: Mapping[str, str] | None = None,
) -> int:
    """Parse a command line, run the command that it names, and return the exit code.

    Parameters
    ----------
    program : str
        What the user types before the command, for example "python -m pam_model".
    description : str
        What the tool is for.
    commands : sequence of Command or NodeCommand
        All that the tool can do.
    arguments : sequence of str, optional
        Words of the command line; those of the process by default.
    default : str, optional
        The command that runs where none is named.
    moved : mapping of str to str, optional
        Commands that were once here, with the command line that replaces each.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    names = [command.name for command in commands]
    if default and (not given or (given[0].startswith("-") and given[0] not in ("-h", "--help"))):
        given.insert(0, default)
    if given and given[0] in (moved or {}):
        print(f"error: {given[0]} is now: {(moved or {})[given[0]]}", file=sys.stderr)
        return MISTAKE
    if given and given[0] in names:
        command = commands[names.index(given[0])]
        if isinstance(command, NodeCommand):
            return command.run(given[1:])
        return run_command(command, f"{program} {command.name}", given[1:])
    parser = _OneLineParser(prog=program, description=description)
    listed = parser.add_subparsers(metavar="COMMAND", required=True, title="commands")
    for command in commands:
        note = " (the default)" if command.name == default else ""
        listed.add_parser(command.name, help=command.summary + note)
    try:
        if given and not given[0].startswith("-"):
            parser.error(f"no command {given[0]!r}; there are {', '.join(names)}")
        parser.parse_args(given)
    except SystemExit as end:
        return _code_of(end)
    raise AssertionError("a command that is listed has run")


def run_command(command: Command, program: str, arguments: Sequence[str] | None = None) -> int:
    """Parse the arguments of one command, run it, and return the exit code.

    Parameters
    ----------
    command : Command
        What is run.
    program : str
        What the user types before the arguments.
    arguments : sequence of str, optional
        Words of the command line; those of the process by default.
    """
    parser = _OneLineParser(
        prog=program,
        description=f"{command.summary[0].upper()}{command.summary[1:]}.",
        epilog="".join(
            ["examples:\n", *(f"  {line}\n" for line in command.examples)]
            if command.examples
            else []
        ),
    )
    command.declare(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="print the result as one JSON document, and nothing else, on standard output",
    )
    if command.bad_news:
        parser.add_argument(
            "--check", action="store_true", help=f"exit code {BAD_NEWS} {command.bad_news}"
        )
    try:
        chosen = parser.parse_args(arguments)
    except SystemExit as end:
        return _code_of(end)
    try:
        outcome = _carry_out(command, chosen)
    except (PamError, OSError, KeyboardInterrupt) as error:
        return _code_after(error)
    if outcome.interrupted:
        return INTERRUPTED
    if outcome.bad_news and command.bad_news and chosen.check:
        for line in outcome.bad_news:
            print(f"check failed: {line}", file=sys.stderr)
        return BAD_NEWS
    return DONE


def _carry_out(command: Command, chosen: Arguments) -> Outcome:
    """Run a command and print what it has found out, as text or as JSON."""
    # text for people has no place beside a document for programs
    hidden = contextlib.redirect_stdout(io.StringIO())
    with hidden if chosen.json else contextlib.nullcontext():
        outcome = command.run(chosen)
    if chosen.json:
        print(json.dumps(plain(outcome.document), indent=1, allow_nan=False))
    sys.stdout.flush()
    return outcome


def _code_after(error: BaseException) -> int:
    """The exit code after a mistake of the user, told in one line, or an interruption."""
    code, text = MISTAKE, f"error: {error}"
    if isinstance(error, KeyboardInterrupt):
        code, text = INTERRUPTED, "stopped"
    elif isinstance(error, BrokenPipeError):
        # keep the interpreter from flushing into the closed pipe when it ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    elif isinstance(error, OSError):
        if error.filename is None:  # nothing that the user has named
            raise error
        text = f"error: {error.filename}: {error.strerror}"
    print(text, file=sys.stderr)
    return code


def _code_of(end: SystemExit) -> int:
    """What argparse ends with, after the help text or a mistake."""
    return end.code if isinstance(end.code, int) else MISTAKE if end.code else DONE


def plain(value: Any) -> Any:
    """The value as JSON knows it: a number that is not finite becomes null.

    Parameters
    ----------
    value : object
        Mappings, sequences, dataclasses, paths, numbers, arrays or text, in each other.
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
    """Told how much of the work is done; shows it if standard error is a terminal."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar

    def show(self, done: float, text: str = "") -> None:
        """How much is done, in the unit of the total, and what is being done now."""
        if text:
            self._bar.set_description_str(text, refresh=False)
        self._bar.update(max(0.0, done - self._bar.n))


@contextlib.contextmanager
def progress(total: float, text: str = "", *, wanted: bool = True) -> Iterator[Progress]:
    """A bar for as long as the work lasts; nothing at all where standard error is no terminal.

    Parameters
    ----------
    total : float
        What `Progress.show` is told at the end.
    text : str, optional
        What is being done.
    wanted : bool, optional
        False shows nothing on a terminal either.
    """
    from tqdm import tqdm  # type: ignore[import-untyped]  # noqa: PLC0415

    form = "{desc} {percentage:3.0f} %|{bar}| {elapsed}<{remaining}"
    # tqdm takes None as "not without a terminal"
    with tqdm(total=total, desc=text, disable=None if wanted else True, bar_format=form) as bar:
        yield Progress(bar)


def add_rig(parser: Parser, *, required: bool = False) -> None:
    """Declare `--rig`; without a default where `required`, else `chosen_rig` finds the example."""
    text = "rig file" if required else "rig file (default: the elbow of config/)"
    parser.add_argument("--rig", type=input_file, required=required, metavar="FILE", help=text)


def chosen_rig(given: Arguments) -> Path:
    """The rig file that was named, or the example in the source tree or where colcon put it.

    Raises
    ------
    PamError
        If none was named and the example is not there.
    """
    if given.rig is not None:
        return Path(given.rig)
    name = Path("config") / "elbow.yaml"
    for folder in (Path.cwd(), *Path(__file__).resolve().parents):
        if (folder / name).is_file():
            return folder / name
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        path = Path(prefix) / "share" / "pam_bringup" / name
        if prefix and path.is_file():
            return path
    raise PamError(f"{name}: not found; name a rig file with --rig")
