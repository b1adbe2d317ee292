"""Checks of the whole suite: fault campaigns, fuzzing, endurance, security, blind diagnosis."""

__version__ = "0.1.0"
