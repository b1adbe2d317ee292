"""The commands of `pam check`, one file per subject."""
