"""The control cycle of all joints: its stages, and what Python does between them."""
