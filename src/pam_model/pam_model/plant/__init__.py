"""The simulated joint: nominal physics and all effects, compiled if numba is installed."""
