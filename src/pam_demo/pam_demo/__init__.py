"""The demo: runs the whole suite on a simulated rig, records it and reports the tracking errors."""

__version__ = "0.1.0"
