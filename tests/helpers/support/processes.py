"""Ends processes of tests."""

from __future__ import annotations

import subprocess


def end(process: subprocess.Popen, patience: float = 20.0) -> None:
    """Politely first: Fast DDS can crash a process that shared memory with a killed one."""
    if process.poll() is not None:
        return
    process.terminate()
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(10.0)
