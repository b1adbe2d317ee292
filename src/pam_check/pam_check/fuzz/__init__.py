"""Random and mutated input at every entrance of the suite."""
