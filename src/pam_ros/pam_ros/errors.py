"""Mistakes that can be found without knowledge of a robot."""


class ParameterError(ValueError):
    """A node's parameter that cannot be used; the message says which, and what was expected."""


class MalformedMessageError(ValueError):
    """Bytes that are not a message of the topic's type; the text contains nothing of them."""
