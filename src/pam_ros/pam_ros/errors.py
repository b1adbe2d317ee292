"""User mistakes that can be found without knowledge of a robot."""


class ParameterError(ValueError):
    """A node's parameter that cannot be used; the message says which, and what was expected."""
