"""Fuzzing: random and mutated input for every interface of the suite."""
