"""Shows a running robot or a recording in a browser, with the viewer of rerun-sdk."""
