"""Pneumatic muscle models, gas, joints, the rig file and a node."""
