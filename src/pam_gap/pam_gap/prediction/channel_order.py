"""Index of each channel of a joint in arrays of measurements and prediction errors."""

from __future__ import annotations

AGONIST_PRESSURE, ANTAGONIST_PRESSURE, POSITION, AGONIST_FORCE, ANTAGONIST_FORCE = range(5)
N_CHANNELS = 5
BOTH_PRESSURES = slice(AGONIST_PRESSURE, ANTAGONIST_PRESSURE + 1)
BOTH_FORCES = slice(AGONIST_FORCE, ANTAGONIST_FORCE + 1)
UNITS = ("Pa", "Pa", "rad", "N", "N")

SPEED = 3
"""Index of the joint's speed in the values to which the observer is reset (after POSITION)."""
