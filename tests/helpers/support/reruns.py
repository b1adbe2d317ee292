"""Why some tests may be tried again; each reason lies in the host, not in the suite."""

HOST_STALLS = (
    "A joint in motion stops, as it must, when the host holds back any of its processes for longer "
    "than sensor_timeout (50 ms) or the watchdog of the boards (100 ms)."
)
EMULATED = (
    "The processor is emulated and ten to twenty times slower, so even patient time-outs of "
    "discovery and of the bus can run out while the kernel does other work."
)
