"""The errors that users of the suite may cause; their messages are written for users."""


class PamError(ValueError):
    """A user's mistake: the message says what is wrong, where, and what was expected."""


class RigError(PamError):
    """A rig file that cannot be used; the message lists every problem found in it."""


class UnknownNameError(PamError, KeyError):
    """A name that does not exist; the message has those that are near."""

    __str__ = PamError.__str__  # that of KeyError shows the text in quotes


class DomainError(PamError):
    """A quantity outside the domain of a model; the message names the quantity and the bound."""
