"""Gains and feedback: the linearised joint, margins, PID and pressure loops."""
