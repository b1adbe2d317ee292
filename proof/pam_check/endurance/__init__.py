"""Endurance checks: hours of motion, killed processes and repeated lifecycle transitions."""
