"""The commands of `python -m pam_check`, one file per subject."""
