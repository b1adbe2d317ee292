"""Length-force models of muscles: one file each in `models`, and what they share."""
