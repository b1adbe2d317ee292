"""The loop over lanes in which most of the time is spent becomes vector code on common processors.

It does not where one address depends on a condition, such as that of `c[a if fills else b]`, which
no result shows. The loop is compiled here for 16 registers of 256 bits, whatever the processor is.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pam_model.plant.compiled import HAVE_NUMBA

COMPILED = """
import numba
from pam_model.plant.lane_choice import LAWS, OF_RIG
from pam_model.plant.lane_kernel import rates
from pam_model.plant.lane_twins import LaneVariant, lane_loop

loop = lane_loop(rates, LaneVariant(frozenset((*OF_RIG, *LAWS)), 2))
row, tables = numba.float64[::1], numba.types.UniTuple(numba.float64[:, ::1], 2)
loop.compile((numba.int64, row, tables, *[row] * 6, numba.boolean, numba.float64))
print(*loop.inspect_llvm().values())
"""


@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba there are no lanes")
@pytest.mark.skipif(platform.machine() != "x86_64", reason="haswell is a processor of this kind")
def test_the_rates_of_all_lanes_are_vector_code(tmp_path: Path) -> None:
    chosen = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": tmp_path}
    code = subprocess.run(
        [sys.executable, "-c", COMPILED],
        env={**os.environ, **{name: str(value) for name, value in chosen.items()}},
        capture_output=True, text=True, check=True, timeout=300,
    ).stdout  # fmt: skip
    assert len(re.findall(r"fdiv contract <4 x double>", code)) >= 4
    assert len(re.findall(r"sqrt\.v4f64", code)) >= 2
