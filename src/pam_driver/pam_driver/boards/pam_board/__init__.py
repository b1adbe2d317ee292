"""The valve board of this project: its frames, their layout and what they mean."""
