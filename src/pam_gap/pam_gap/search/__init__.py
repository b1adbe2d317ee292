"""The search for the effects that explain recordings."""
