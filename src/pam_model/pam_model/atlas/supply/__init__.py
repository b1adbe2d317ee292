"""From the reservoir to the muscle: what tubes, dead space and heat cost. See also `gas`."""
