"""The rate at which this computer can run the demo: tried, and halved until the loops keep it.

The robot, its simulation and the recorder share the processors. A computer that is slow, or busy
with other programs, is late in some cycles at the suite's usual rate; the demo then runs at a rate
that it holds, and says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from pam_demo.motions import DemoMotion, chirp
from pam_model.errors import PamError

RATES: Final = (500.0, 250.0, 125.0)
"""Rates of the loops that are tried [Hz], the usual one first."""
MOST_LATE: Final = 0.005
"""Largest share of late cycles at which a rate is held; half of what the page allows."""


class TooSlowError(PamError):
    """The loops do not keep their rate; the message says how that showed."""


@dataclass(frozen=True, slots=True)
class RateNotHeld:
    """A rate that was tried [Hz], and what showed that this computer does not hold it."""

    rate: float
    reason: str


def trial() -> DemoMotion:
    """The motion that is played to see whether a rate is held; it takes no part in the figures."""
    return replace(
        chirp(amplitude=0.1, low=0.2, high=1.0, duration=4.0),
        name="trial",
        title="trial of the loops' rate",
    )


def judge(late: float) -> None:
    """Refuse a rate at which too many cycles are late.

    Parameters
    ----------
    late : float
        Share of late and skipped cycles during the trial, of the loop that has more of them.

    Raises
    ------
    TooSlowError
        If it is above `MOST_LATE`.
    """
    if late > MOST_LATE:
        raise TooSlowError(f"{100.0 * late:.2g} % of the cycles were late")


def rate_sentence(
    rate: float, not_held: Sequence[RateNotHeld], *, chosen: bool = False, late: bool = False
) -> str:
    """What page and terminal say of the rate.

    Parameters
    ----------
    rate : float
        At which the loops ran [Hz].
    not_held : sequence of RateNotHeld
        The rates that were tried before.
    chosen : bool
        The user named the rate, and nothing was tried.
    late : bool
        More cycles were late than the page allows, although the trial kept the rate.
    """
    if chosen:
        return f"The loops ran at {rate:g} Hz, as the option --rate asks."
    if not not_held:
        return f"The loops ran at {rate:g} Hz, which this computer " + (
            "held in the trial, but not throughout: other programs keep it busy."
            if late
            else "holds."
        )
    tried = " and ".join(f"{one.rate:g} Hz ({one.reason})" for one in not_held)
    return (
        f"This computer did not hold {tried}, so the loops ran at {rate:g} Hz; the targets of the "
        f"figures are those of {RATES[0]:g} Hz."
    )
