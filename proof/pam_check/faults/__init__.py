"""The fault campaign: injects faults into a moving chain and checks the reactions."""
