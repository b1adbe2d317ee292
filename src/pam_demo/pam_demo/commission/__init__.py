"""From the numbers of a data sheet to a joint that tracks, on a running robot."""
