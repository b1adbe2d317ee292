"""The command that writes what the documentation shows of the code."""

from __future__ import annotations

from pathlib import Path

from pam_model.argument_types import input_file, input_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser


def _declare_pages(parser: Parser) -> None:
    parser.add_argument(
        "clone",
        type=input_folder,
        nargs="?",
        default=Path(),
        metavar="CLONE",
        help="a clone of this project (default: this folder)",
    )
    parser.add_argument("--pictures", action="store_true", help="also draw all models and effects")
    parser.add_argument(
        "--comparison",
        type=input_file,
        metavar="FILE",
        help="what `pam model compare --json` printed, for docs/models.md",
    )


def _pages(given: Arguments) -> Outcome:
    from pam_check.doc_pages.pages import run  # noqa: PLC0415  (matplotlib, numba)

    return run(given)


COMMANDS = (
    Command(
        "pages",
        "update tables and pages of the documentation, and config/controller.yaml, from the code",
        _declare_pages,
        _pages,
        examples=("pam check pages --pictures",),
    ),
)
