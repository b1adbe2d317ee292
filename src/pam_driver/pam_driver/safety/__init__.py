"""What the driver may do and when: states, checks of commands and of measurements."""
