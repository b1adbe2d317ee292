"""The kinds of valve board that the driver supports."""
