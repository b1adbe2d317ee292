"""The commands of `pam model`, one file per subject."""
