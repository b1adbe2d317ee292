"""Tools that fit, compare, design and draw muscle models: `python -m pam_model`."""
