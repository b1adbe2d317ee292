"""Launch files that start the nodes of the PAM suite."""

__version__ = "0.1.0"
