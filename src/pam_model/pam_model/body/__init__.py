"""Rigid bodies on hinges: their equation of motion, and the contacts that stop them."""
