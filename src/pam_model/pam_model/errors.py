"""The errors a user of the suite may meet, each with a message fit to be shown to them."""


class PamError(ValueError):
    """A user's mistake: the message names what, where and what was expected."""


class RigError(PamError):
    """A rig file that cannot be used; the message lists every problem found in it."""


class DomainError(PamError):
    """A quantity outside the domain of a model; the message names the quantity and the bound."""
