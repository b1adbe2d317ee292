"""The valve board of this project: its frames, their layout and their meaning."""
