"""Simulated rig with valve boards on a CAN bus, and the demo."""
