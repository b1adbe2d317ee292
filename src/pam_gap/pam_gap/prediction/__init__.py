"""Simulation of the plant along a recording, and the differences between the two."""
