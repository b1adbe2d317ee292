"""The kinds of valve board that the driver can talk to."""
