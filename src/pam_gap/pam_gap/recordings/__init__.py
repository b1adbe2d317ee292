"""Recordings read, put on an even grid, and judged for noise."""
