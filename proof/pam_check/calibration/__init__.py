"""Rigs whose files are off by a third, and whether a calibration finds their numbers."""
