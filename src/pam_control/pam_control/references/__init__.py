"""What each joint should do: trajectories, streamed references, holding."""
