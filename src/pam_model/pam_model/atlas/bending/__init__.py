"""Muscles that bend instead of changing length: one file per model."""
