"""The command `pam`: tools and nodes of the suite by name."""

__version__ = "0.1.0"
