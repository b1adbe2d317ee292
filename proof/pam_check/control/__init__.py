"""The controller in closed loop with the independent plant of the blind check."""
