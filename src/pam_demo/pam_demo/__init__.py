"""The demo: the whole suite at work on a simulated rig, recorded, measured and shown on a page."""

__version__ = "0.1.0"
