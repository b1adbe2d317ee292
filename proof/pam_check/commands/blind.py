"""Commands that score the diagnosis on rigs whose effects it does not know."""

from __future__ import annotations

import os

from pam_model.argument_types import count, input_path, number
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_out


def _declare_blind(parser: Parser) -> None:
    parser.add_argument(
        "--cases",
        type=count(),
        default=24,
        metavar="N",
        help="number of rigs to draw (default: %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=count(0),
        metavar="N",
        help="seed of all random draws (default: from the clock)",
    )
    add_out(parser, "out/blind")
    parser.add_argument(
        "--workers",
        type=count(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of parallel diagnoses (default: one per processor)",
    )
    parser.add_argument(
        "--experiments",
        action="store_true",
        help="run the experiments that ambiguous diagnoses propose, and diagnose again",
    )
    parser.add_argument(
        "--keep-evidence",
        action="store_true",
        help="keep the evidence that `sensitivity` needs to decide every case again",
    )
    parser.add_argument(
        "--background",
        action="store_true",
        help="draw rigs as they are: each with an ordinary background of small imperfections",
    )
    parser.add_argument(
        "--varied",
        action="store_true",
        help="draw rigs with a background of many sizes (10 N to 5 kN) and kinds: unequal muscles, "
        "horizontal joints, slow motions, sparse logs; each of two effects has its own strength",
    )
    parser.add_argument(
        "--plant",
        choices=["first", "second"],
        default="first",
        help="laws that make the recordings: `second` is from other literature "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with the interrupted campaign in --out "
        "(same --cases, --seed, --background, --varied and --plant)",
    )


def _blind(given: Arguments) -> Outcome:
    from pam_check.blind.campaign import run  # noqa: PLC0415  (scipy, matplotlib)

    return run(given)


def _declare_sensitivity(parser: Parser) -> None:
    parser.add_argument(
        "folder", type=input_path, help="the --out folder of `blind --keep-evidence`"
    )
    parser.add_argument(
        "--percent",
        type=number("%", above=0.0, most=95.0),
        default=30.0,
        metavar="P",
        help="change of each constant, downwards and upwards [%%] (default: %(default)g)",
    )
    parser.add_argument(
        "--rediagnose",
        type=count(0),
        default=0,
        metavar="N",
        help="number of cases to diagnose again for each constant that acts before the decision "
        "(default: 0, such constants are skipped)",
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="CONSTANT",
        help="only this constant, for example statement.outside; may be given several times",
    )
    parser.add_argument(
        "--workers",
        type=count(),
        default=1,
        metavar="N",
        help="number of parallel diagnoses (default: 1)",
    )


def _sensitivity(given: Arguments) -> Outcome:
    from pam_check.blind.sensitivity import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_decide_again(parser: Parser) -> None:
    parser.add_argument(
        "folder", type=input_path, help="the --out folder of `blind --keep-evidence`"
    )


def _decide_again(given: Arguments) -> Outcome:
    from pam_check.blind.decided_again import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_campaigns(parser: Parser) -> None:
    parser.add_argument(
        "folders", type=input_path, nargs="+", help="--out folders of `blind --keep-evidence`"
    )


def _calibrate_statement(given: Arguments) -> Outcome:
    from pam_check.blind.calibrate_statement import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _learned_belief(given: Arguments) -> Outcome:
    from pam_check.blind.learned_belief import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


COMMANDS = (
    Command(
        "blind",
        "diagnose randomly drawn rigs with hidden effects, and score the answers",
        _declare_blind,
        _blind,
        bad_news="if a diagnosis crashed",
        examples=("pam check blind --cases 120 --seed 1097762585 --experiments",),
    ),
    Command(
        "sensitivity",
        "change each constant of the diagnosis and count the changed verdicts of a campaign",
        _declare_sensitivity,
        _sensitivity,
        examples=(
            "pam check blind --cases 24 --keep-evidence --out out/blind",
            "pam check sensitivity out/blind --rediagnose 2",
        ),
    ),
    Command(
        "decide-again",
        "decide a finished campaign again, and show what changes",
        _declare_decide_again,
        _decide_again,
        examples=("pam check decide-again out/blind",),
    ),
    Command(
        "calibrate-statement",
        "find the numbers of the statement of belief that drawn rigs calibrate",
        _declare_campaigns,
        _calibrate_statement,
        examples=("pam check calibrate-statement out/blind",),
    ),
    Command(
        "learned-belief",
        "compare the statement of belief with weights that are learned from drawn rigs",
        _declare_campaigns,
        _learned_belief,
        examples=("pam check learned-belief out/blind",),
    ),
)
