"""A faster kernel is compiled beside the work, and used when it is ready."""

import threading

from pam_model.plant.compile_beside import WORTH, CompileBeside


def test_little_work_compiles_nothing() -> None:
    kernels, calls = CompileBeside(), []
    assert not kernels.is_ready("a", WORTH // 2, lambda: calls.append("a"))
    assert not kernels.is_ready("a", WORTH // 4, lambda: calls.append("a"))
    assert calls == []


def test_the_work_goes_on_until_the_kernel_is_ready() -> None:
    kernels, go_on, done = CompileBeside(), threading.Event(), threading.Event()

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


def test_a_kernel_that_cannot_be_compiled_is_not_used(monkeypatch) -> None:
    told = []
    monkeypatch.setattr(threading, "excepthook", told.append)
    kernels = CompileBeside()

    def fails() -> None:
        raise RuntimeError("no such instruction")

    kernels.is_ready("a", WORTH, fails)
    for thread in threading.enumerate():
        if thread.name == "compile":
            thread.join(10.0)
    assert len(told) == 1
    assert not kernels.is_ready("a", WORTH, fails)
