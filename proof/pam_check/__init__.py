"""Checks of the whole suite: fault campaigns, fuzzing, endurance, security, blind diagnosis."""
