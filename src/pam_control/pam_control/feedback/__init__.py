"""Feedback and gain design: the linearised joint, stability margins, PID and pressure loops."""
