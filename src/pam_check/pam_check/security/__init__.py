"""The SROS 2 policy, and whether the nodes keep to it."""
