"""The simulated joint: nominal physics and every effect, compiled where numba is installed."""
