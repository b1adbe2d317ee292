"""Diagnosis of the gap between a recording of a real rig and its simulation."""
