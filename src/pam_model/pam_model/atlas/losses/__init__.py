"""Hysteresis and creep elements a muscle's static force is missing: one file per element."""
