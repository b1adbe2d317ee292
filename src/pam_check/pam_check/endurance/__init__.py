"""Hours of driving, killed hosts and repeated lifecycle transitions."""
