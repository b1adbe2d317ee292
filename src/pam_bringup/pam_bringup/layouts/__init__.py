"""Layouts of a robot for Foxglove and PlotJuggler, made of its rig file."""
