"""The mistakes of a user that can be found without knowing any robot."""


class ParameterError(ValueError):
    """A node's parameter that cannot be used; the message names it and what was expected."""
