"""References of the joints: trajectories, streamed commands, hold."""
