"""Iterative learning: a motion that is repeated becomes more exact from one time to the next."""
