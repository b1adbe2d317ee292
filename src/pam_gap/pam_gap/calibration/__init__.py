"""From a log to a rig file: the numbers of a rig from recordings of it."""
