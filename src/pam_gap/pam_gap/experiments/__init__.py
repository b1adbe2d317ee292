"""What to record next, and playing it on the rig."""
