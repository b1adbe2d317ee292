"""The SROS 2 policy, and a check that the nodes comply with it."""
