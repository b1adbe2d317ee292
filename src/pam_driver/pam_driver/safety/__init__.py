"""The driver's safety: states, checks of commands, and checks of measurements."""
