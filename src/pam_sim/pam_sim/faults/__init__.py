"""Faults of rigs, boards and frames: their list, and how each is brought about."""
