"""Muscles as springs, dampers and friction with fitted coefficients: one file per model."""
