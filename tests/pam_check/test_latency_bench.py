"""The benchmark of the latency finds the command that answers a jump of a measurement."""

import importlib.util
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "benchmarks" / "latency_bench.py"


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location("latency_bench", BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("lasting", [0.008, 1.0])
def test_the_answer_is_found_whether_or_not_the_loop_takes_it_back(bench, lasting):
    """Commands every 2 ms; each jump is answered after 3 to 5 ms, and the answer ends again."""
    jumps, late = [0.0505 + 0.06 * k for k in range(20)], 0.003
    times = [0.001 * k for k in range(1400)]
    pressures = [(t, 2e5 + 4e3 * (sum(at <= t for at in jumps) % 2)) for t in times]
    commands = []
    for t in times[::2]:
        answered = [at for at in jumps if at + late <= t < at + late + lasting]
        noise = 1e-4 * (round(1e3 * t) % 3)
        commands.append((t, noise + (0.05 * len(answered))))
    found = bench.answers(pressures, commands)
    assert len(found) == len(jumps)
    assert all(late - 0.001 <= time <= late + 0.003 for time in found)
