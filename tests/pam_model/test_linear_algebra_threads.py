"""Protects that results do not depend on the number of processors: one thread of linear algebra."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from pam_model.linear_algebra_threads import ONE_THREAD

PROGRAM = """
import os, sys
import {package}.__main__ as tool
sys.argv = ["tool", "--version"]
tool.main()
assert "numpy" not in sys.modules, "the linear algebra has its threads already"
import numpy, scipy.linalg
scipy.linalg.qr(numpy.ones((600, 600)) @ numpy.ones((600, 600)))
print(len(os.listdir("/proc/self/task")))
"""


def threads_of(package: str, **environment: str) -> int:
    """Threads of a process that ran a tool and then linear algebra."""
    others = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(package=package)],
        env=others | environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return int(done.stdout.split()[-1])


@pytest.mark.parametrize("package", ["pam_gap", "pam_check", "pam_demo", "pam_model"])
def test_tools_do_their_linear_algebra_with_one_thread(package):
    assert threads_of(package) == 1


@pytest.mark.skipif(os.cpu_count() == 1, reason="OpenBLAS has one thread on one processor")
def test_number_of_threads_that_the_user_has_set_stays():
    assert threads_of("pam_gap", OPENBLAS_NUM_THREADS="2") > 1
