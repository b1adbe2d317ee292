"""Compensation of the effects in the rig file: torque feedforward, valve and sensor inverses."""
