"""The command `pam`: tools and nodes of the suite by name."""
