"""The demo: runs the whole suite on a simulated rig, records it and reports the tracking errors."""
