"""Faults of rigs, boards and frames: their list, and their simulation."""
