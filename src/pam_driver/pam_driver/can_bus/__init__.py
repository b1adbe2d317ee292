"""One CAN bus: opening it, its frames, and identifiers with their flags."""
