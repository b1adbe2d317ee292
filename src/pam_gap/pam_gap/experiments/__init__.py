"""The next experiment: its choice, its files, and the node that plays it on the rig."""
