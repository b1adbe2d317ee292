"""Checks of the whole suite: fault campaigns, fuzzing, endurance, security, withheld effects."""

__version__ = "0.1.0"
