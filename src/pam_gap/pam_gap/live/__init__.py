"""The gap of a running rig."""
