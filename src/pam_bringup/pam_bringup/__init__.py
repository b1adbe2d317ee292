"""Launch files that put the nodes of the PAM suite together."""

__version__ = "0.1.0"
