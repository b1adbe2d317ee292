"""The errors that users of the suite may cause; their messages are written for users."""

from collections.abc import Iterator
from contextlib import contextmanager


class PamError(ValueError):
    """A user's mistake: the message says what is wrong, where, and what was expected."""


class RigError(PamError):
    """A rig file that cannot be used; the message lists every problem found in it."""


class UnknownNameError(PamError, KeyError):
    """A name that does not exist; the message has those that are near."""

    __str__ = PamError.__str__  # that of KeyError shows the text in quotes


class DomainError(PamError):
    """A quantity outside the domain of a model; the message names the quantity and the bound."""


class Reasons:
    """Gathers what several checks refuse, so that a user mends all of it at once.

    Parameters
    ----------
    raised : type of PamError
        The error that `refuse` raises.
    """

    def __init__(self, raised: type[PamError]) -> None:
        self.raised = raised
        self.lines: list[str] = []

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Run a check whose refusal is kept for `refuse`, once if several checks say the same."""
        try:
            yield
        except PamError as error:
            self.lines += [line for line in str(error).splitlines() if line not in self.lines]

    def refuse(self) -> None:
        """Raise an error with one line for each reason, if there are any.

        Raises
        ------
        PamError
            Of the type `raised`.
        """
        if self.lines:
            raise self.raised("\n".join(self.lines))
