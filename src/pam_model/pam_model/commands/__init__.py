"""The commands of `python -m pam_model`, one file per subject."""
