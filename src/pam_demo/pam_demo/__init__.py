"""The demo: the whole suite at work on a simulated rig, recorded, measured and shown on a page."""
