"""The end of a driver, whatever its I/O thread does meanwhile."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from pam_driver.driver_end import end_driver


class Ending:
    """A driver that holds a joint, and notes what its end asks of it."""

    def __init__(self, *, lock_is_free: bool = True) -> None:
        self.calls: list[str] = []
        self.complaints: list[str] = []
        self.lowers, self._free = False, lock_is_free

    def deactivate(self, _: float) -> None:
        self.calls.append("deactivate")
        self.lowers = True

    def stop_stalled(self, _: str, __: float) -> bool:
        self.calls.append("vent although stalled")
        self.lowers = False
        return self._free

    def vent_at_once(self, _: float) -> None:
        assert self._free, "it would wait for the lock forever"
        self.calls.append("vent")

    def close(self, _: float) -> None:
        assert self._free
        self.calls.append("close")

    def end(self, loop: Any) -> None:
        port: Any = SimpleNamespace(name="can0", close=lambda: self.calls.append("port"))
        driver: Any = self
        end_driver(driver, loop, [port], lambda: False, self.complaints.append)


class StalledLoop:
    """A loop that goes on for a number of cycles; the next one does not return."""

    def __init__(self, cycles: int = 0) -> None:
        self._cycles, self.running = cycles, True
        self._count = 0

    @property
    def busy(self) -> bool:
        return self._cycles == 0

    @property
    def statistics(self) -> SimpleNamespace:
        if self._cycles:
            self._cycles -= 1
            self._count += 1
        return SimpleNamespace(cycles=self._count)

    def stop(self, timeout: float) -> None:
        raise TimeoutError(f"did not end within {timeout:g} s")


@pytest.mark.parametrize(("cycles", "begun"), [(0, []), (5, ["deactivate"])])
def test_a_cycle_that_does_not_return_vents_at_once(cycles: int, begun: list[str]) -> None:
    """It would never end the lowering, and boards without a watchdog would hold the joint."""
    ending, began = Ending(), time.monotonic()
    ending.end(StalledLoop(cycles))
    assert ending.calls == [*begun, "vent although stalled", *["vent"] * 5, "close", "port"]
    assert "has not returned" in ending.complaints[0]
    assert time.monotonic() - began < 5.0


def test_a_cycle_that_keeps_the_lock_does_not_keep_the_end() -> None:
    """A bus whose library does not return; only the boards' watchdogs vent then."""
    ending = Ending(lock_is_free=False)
    ending.end(StalledLoop())
    assert ending.calls == ["vent although stalled", "port"]
