"""Tools for bringing up the boards of a rig: check its file, look at the bus, set a valve."""
