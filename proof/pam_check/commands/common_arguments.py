"""Arguments that several checks have."""

from __future__ import annotations

import os

from pam_model.argument_types import count
from pam_model.command_line import Parser


def add_kinds(parser: Parser) -> None:
    """Declare the option that picks kinds of fault."""
    parser.add_argument(
        "--kind", action="append", help="only this fault; may be given several times"
    )


def add_jobs(parser: Parser) -> None:
    """Declare the option for the number of parallel trials."""
    parser.add_argument(
        "--jobs",
        type=count(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of trials at the same time (default: the number of processors)",
    )


def add_seed(parser: Parser, default: int) -> None:
    """Declare the option for the seed of all random draws."""
    parser.add_argument(
        "--seed",
        type=count(0),
        default=default,
        metavar="N",
        help="seed of all random draws (default: %(default)s)",
    )


def add_inputs(parser: Parser) -> None:
    """Declare the options for the number of random inputs and their seed."""
    parser.add_argument(
        "--count",
        type=count(),
        default=100_000,
        metavar="N",
        help="number of inputs, run in blocks of a thousand (default: %(default)s)",
    )
    add_seed(parser, 0)


def add_one_process(parser: Parser) -> None:
    """`--one-process`: driver and controller as the program of the robot runs them."""
    parser.add_argument(
        "--one-process",
        action="store_true",
        help="driver and controller share one cycle (default: they exchange messages)",
    )
