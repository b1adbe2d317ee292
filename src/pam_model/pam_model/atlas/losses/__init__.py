"""Hysteresis and creep elements that complement a static force model: one file per element."""
