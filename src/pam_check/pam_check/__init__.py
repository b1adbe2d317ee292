"""Checks of the whole suite: fault campaigns, fuzzing, endurance, security, withheld effects."""
