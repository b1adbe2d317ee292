"""The fault campaign: faults injected into a moving chain, and what must follow."""
