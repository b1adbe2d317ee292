"""Commands that write pages of the documentation from the code."""

from __future__ import annotations

from pam_model.argument_types import input_file, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser, add_rig
from pam_model.errors import PamError


def _declare_effects(parser: Parser) -> None:
    add_rig(parser)
    _declare_rules(parser)


def _effects(given: Arguments) -> Outcome:
    from pam_check.doc_pages.effects_page import run  # noqa: PLC0415  (matplotlib, numba)

    return run(given)


def _declare_rules(parser: Parser) -> None:
    parser.add_argument(
        "--out", type=output_folder, default="docs", help="folder (default: %(default)s)"
    )


def _rules(given: Arguments) -> Outcome:
    from pam_check.doc_pages.constants_page import run  # noqa: PLC0415

    return run(given)


def _declare_fault_tables(parser: Parser) -> None:
    parser.add_argument(
        "pages", type=input_file, nargs="+", metavar="PAGE", help="Markdown file with the marks"
    )


def _fault_tables(given: Arguments) -> Outcome:
    from pam_check.fault_kinds.kinds import write_into  # noqa: PLC0415

    for page in given.pages:
        try:
            text = write_into(page.read_text(encoding="utf-8"))
        except (PamError, UnicodeDecodeError) as error:
            raise PamError(f"{page}: {error}") from None
        page.write_text(text, encoding="utf-8")
        print(f"written: {page}")
    return Outcome({"written": given.pages})


COMMANDS = (
    Command("effects", "write the page of effects", _declare_effects, _effects),
    Command("rules", "write the page of constants of the diagnosis", _declare_rules, _rules),
    Command(
        "fault-tables",
        "update the tables of states and faults in a page of the documentation",
        _declare_fault_tables,
        _fault_tables,
        examples=("pam check fault-tables docs/safety_tables.md",),
    ),
)
