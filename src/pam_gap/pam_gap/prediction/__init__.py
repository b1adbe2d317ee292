"""The plant run along a recording, and how far the two differ."""
