"""Launch files that put the nodes of the PAM suite together."""
