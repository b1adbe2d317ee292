"""Muscles modelled as springs, dampers and friction with fitted coefficients: one file each."""
