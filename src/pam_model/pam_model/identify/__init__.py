"""Tools that fit, compare, design and draw muscle models: `pam model`."""
