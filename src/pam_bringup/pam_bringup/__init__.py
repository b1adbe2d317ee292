"""Launch files that start the nodes of the PAM suite."""
