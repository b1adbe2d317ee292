"""Air supply from the reservoir to the muscle: tubes, dead space and heat. See also `gas`."""
