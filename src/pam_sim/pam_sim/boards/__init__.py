"""Simulated valve boards."""
