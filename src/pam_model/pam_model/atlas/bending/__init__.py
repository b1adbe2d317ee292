"""Muscles that bend instead of changing their length: one file per model."""
