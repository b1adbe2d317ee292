"""Where machine code of the plant is kept."""

import importlib.util
import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from pam_model.plant import compiled


def test_a_read_only_installation_keeps_machine_code_in_the_users_cache(
    tmp_path: Path, monkeypatch
) -> None:
    installed = tmp_path / "installed"
    installed.write_text("no folder can be made in it")
    monkeypatch.setattr(compiled, "_HERE", installed)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = Path(compiled._cache_folder())
    assert folder.parent == tmp_path / "cache" / "pam_model"
    assert os.access(folder, os.W_OK)


def test_without_any_folder_nothing_is_kept(tmp_path: Path, monkeypatch) -> None:
    installed = tmp_path / "installed"
    installed.write_text("")
    monkeypatch.setattr(compiled, "_HERE", installed)
    monkeypatch.setenv("XDG_CACHE_HOME", str(installed))
    assert compiled._cache_folder() == ""


@pytest.fixture
def doubled(tmp_path: Path, monkeypatch):
    """Compiles a function as a new process does, with its machine code in a folder of the test."""
    pytest.importorskip("numba", reason="without numba nothing is kept")
    if not compiled.HAVE_NUMBA:
        pytest.skip("without numba nothing is kept")
    source = tmp_path / "doubled.py"
    source.write_text("def doubled(x):\n    return 2.0 * x\n")
    monkeypatch.setattr(compiled, "_CACHE", str(tmp_path / "kept"))

    def start():
        spec = importlib.util.spec_from_file_location("doubled", source)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return compiled.entry_point(module.doubled)

    return start


def kept(tmp_path: Path) -> dict[str, int]:
    """Sizes of the files with machine code and of their indices."""
    return {path.suffix: path.stat().st_size for path in (tmp_path / "kept").rglob("*.nb?")}


@pytest.mark.parametrize("damaged", [".nbi", ".nbc"])
@pytest.mark.parametrize("length", [0, 40])
def test_machine_code_that_a_power_cut_damaged_is_compiled_again(
    doubled, tmp_path, damaged, length
) -> None:
    assert doubled()(3.0) == 6.0
    whole = kept(tmp_path)
    (file,) = (tmp_path / "kept").rglob(f"*{damaged}")
    file.write_bytes(file.read_bytes()[:length])
    assert doubled()(4.0) == 8.0
    mended = kept(tmp_path)
    assert mended.keys() == whole.keys()
    # numba counts the functions of a process, and the count is part of the machine code
    assert mended[damaged] == pytest.approx(whole[damaged], rel=0.02)
    assert doubled()(5.0) == 10.0
    assert kept(tmp_path) == mended


def test_a_full_disk_costs_the_next_start_only_time(doubled, tmp_path, caplog) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    function = doubled()
    resource.setrlimit(resource.RLIMIT_FSIZE, (20, limits[1]))
    try:
        assert function(3.0) == 6.0
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "machine code" in caplog.text
    assert str(tmp_path / "kept") in caplog.text
    assert doubled()(4.0) == 8.0
    assert set(kept(tmp_path)) == {".nbi", ".nbc"}


def test_without_any_folder_a_function_is_compiled_all_the_same(
    doubled, tmp_path, monkeypatch
) -> None:
    blocked = tmp_path / "__pycache__"
    blocked.write_text("no folder can be made here")
    monkeypatch.setattr(compiled, "_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setenv("HOME", str(blocked))
    assert doubled()(3.0) == 6.0


LAWS = (
    "import math\n"
    "def laws(row, x):\n"
    "    for i in range(len(row)):\n"
    "        y = row[i]\n"
    "        row[i] = math.sin(y) + math.exp(-x) + y**x + math.expm1(x) + math.hypot(x, y)\n"
    "        row[i] += math.atan2(x, y) + math.log(x) + math.tanh(y) + y % x + y // x + round(y)\n"
    "    return row[0], x > 0.5\n"
)
AGAIN = (
    "import sys, numpy\n"
    "from pam_model.plant import compiled\n"
    "sys.path.insert(0, sys.argv[1])\n"
    "compiled._CACHE = sys.argv[2]\n"
    "import laws\n"
    "made, row = compiled.entry_point(laws.laws), numpy.array([0.3, 1.7, 2.9])\n"
    "before = set(sys.modules)\n"
    "compiled.prepare(made, row, 0.0)\n"
    "found = made(row, 0.7)\n"
    "print(len(set(sys.modules) - before))\n"
    "print(repr([*found, *row.tolist()]))\n"
)


@pytest.mark.skipif(not compiled.HAVE_NUMBA, reason="without numba nothing is kept")
def test_what_is_compiled_already_is_read_without_what_can_compile(tmp_path: Path) -> None:
    """Importing it would take longer than all else at the start of a controller."""
    (tmp_path / "laws.py").write_text(LAWS)
    words = [sys.executable, "-c", AGAIN, str(tmp_path), str(tmp_path / "kept")]
    (first, one), (second, other) = (
        subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
        for _ in range(2)
    )
    assert int(second) < 20 < int(first)
    scope: dict = {}
    exec(LAWS, scope)
    row = [0.3, 1.7, 2.9]
    plain = [*scope["laws"](row, 0.7), *row]
    assert one == other == repr(plain)
    assert all(map(math.isfinite, row))


ALLOCATES = (
    "import sys, numba, numpy\n"
    "sys.path.insert(0, sys.argv[1])\n"
    "from pam_model.machine_code_cache import keep_machine_code\n"
    "import sums\n"
    "print(keep_machine_code(numba.njit(sums.total))(4))\n"
)


@pytest.mark.skipif(not compiled.HAVE_NUMBA, reason="without numba nothing is kept")
def test_what_makes_arrays_and_is_read_before_anything_is_compiled_ends_no_process(
    tmp_path: Path,
) -> None:
    (tmp_path / "sums.py").write_text(
        "import numpy\ndef total(n):\n    made = numpy.ones(n)\n    return made.sum()\n"
    )
    words = [sys.executable, "-c", ALLOCATES, str(tmp_path)]
    for _ in range(2):
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (0, "4.0\n"), done.stderr
    assert list(tmp_path.rglob("*.nbc"))
