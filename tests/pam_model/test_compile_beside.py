"""A faster kernel is compiled beside the work, and used when it is ready."""

import threading

import pytest

from pam_model.plant import compile_beside, compiled
from pam_model.plant.compile_beside import WORTH, CompileBeside
from pam_model.plant.compiled import HAVE_NUMBA


@pytest.fixture(autouse=True)
def _compilation_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unlike in the other tests of the short run."""
    monkeypatch.setattr(compile_beside, "WORTH", WORTH)


def test_little_work_compiles_nothing() -> None:
    kernels, calls = CompileBeside("none"), []
    assert not kernels.is_ready("a", WORTH // 2, lambda: calls.append("a"))
    assert not kernels.is_ready("a", WORTH // 4, lambda: calls.append("a"))
    assert calls == []


def test_the_work_goes_on_until_the_kernel_is_ready() -> None:
    kernels, go_on, done = CompileBeside("none"), threading.Event(), threading.Event()

    def compile_it() -> None:
        go_on.wait()
        done.set()

    assert not kernels.is_ready("a", WORTH, compile_it)
    assert not kernels.is_ready("a", WORTH, compile_it)
    go_on.set()
    assert done.wait(10.0)
    for thread in threading.enumerate():
        if thread.name == "compile":
            thread.join(10.0)
    assert kernels.is_ready("a", 1, compile_it)
    assert not kernels.is_ready("b", 1, compile_it)


def test_one_kernel_is_compiled_at_a_time() -> None:
    kernels, go_on, begun = CompileBeside("none"), threading.Event(), []

    def compile_it(name: str) -> None:
        begun.append(name)
        go_on.wait(10.0)

    assert not kernels.is_ready("a", WORTH, lambda: compile_it("a"))
    assert not kernels.is_ready("b", WORTH, lambda: compile_it("b"))
    go_on.set()
    for thread in threading.enumerate():
        if thread.name == "compile":
            thread.join(10.0)
    assert begun == ["a"]
    kernels.is_ready("b", 1, lambda: compile_it("b"))
    for thread in threading.enumerate():
        if thread.name == "compile":
            thread.join(10.0)
    assert begun == ["a", "b"]


def test_machine_code_on_disk_is_used_for_any_work() -> None:
    kernels, calls = CompileBeside("none"), []
    assert kernels.is_ready("a", 1, lambda: calls.append("a"), on_disk=True)
    assert kernels.is_ready("a", 1, lambda: calls.append("again"), on_disk=True)
    assert calls == ["a"]


@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba there is no machine code")
def test_machine_code_on_disk_is_found_by_name(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compiled, "_CACHE", str(tmp_path))

    def twice_a_number(x: float) -> float:
        return 2.0 * x

    twice_a_number.__qualname__ = "twice_a_number"
    entry = compiled.entry_point(twice_a_number)
    assert not compiled.is_on_disk("twice_a_number")
    assert entry(2.0) == 4.0
    assert compiled.is_on_disk("twice_a_number")
    assert not compiled.is_on_disk("a_number")


def test_a_kernel_that_cannot_be_compiled_is_not_used(monkeypatch) -> None:
    told = []
    monkeypatch.setattr(threading, "excepthook", told.append)
    kernels = CompileBeside("none")

    def fails() -> None:
        raise RuntimeError("no such instruction")

    kernels.is_ready("a", WORTH, fails)
    for thread in threading.enumerate():
        if thread.name == "compile":
            thread.join(10.0)
    assert len(told) == 1
    assert not kernels.is_ready("a", WORTH, fails)
