"""What C reaches with the nominal joint of benchmarks/limit.c, where a compiler is found."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

SOURCE = Path(__file__).with_name("limit.c")


def c_rates() -> dict[str, float]:
    """Million steps/s, `scalar` and with `lanes` in vectors; empty without a compiler.

    With NUMBA_CPU_NAME, it is compiled for the processor that numba compiles for.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        return {}
    cpu = os.environ.get("NUMBA_CPU_NAME", "native")
    with tempfile.TemporaryDirectory() as folder:
        made = str(Path(folder) / "limit")
        flags = ["-O3", f"-march={cpu}", "-ffast-math", "-fopenmp-simd"]
        subprocess.run([compiler, *flags, str(SOURCE), "-o", made, "-lm"], check=True)
        found = subprocess.run([made], check=True, capture_output=True, text=True)
    rates = json.loads(found.stdout)
    return {name: rates[name] for name in ("scalar", "lanes")}
