"""A driver that stood still says so first, before what came of it."""

from __future__ import annotations

import re

import pytest

from pam_check.faults.campaign import in_a_fork


@pytest.mark.parametrize("seconds", [0.2, 5.0])
def test_after_a_pause_of_the_driver_the_pause_is_the_first_reason(chain, seconds):
    def reasons() -> list[str]:
        chain.driver_runs = False
        chain.wait(seconds)
        chain.driver_runs = True
        chain.wait(0.5)
        return [str(fault) for fault in chain.driver.faults]

    first, *others = in_a_fork(reasons)
    assert re.match(rf"the driver stood still for {seconds}\d* s", first)
    assert any("watchdog" in text for text in others)


def test_a_short_pause_without_a_consequence_is_no_fault(chain):
    def pause() -> tuple[str, int]:
        chain.driver_runs = False
        chain.wait(0.06)
        chain.driver_runs = True
        chain.wait(0.5)
        return chain.driver.state.value, len(chain.driver.conditions)

    assert in_a_fork(pause) == ("active", 0)


def test_a_pause_inside_a_cycle_is_a_pause_and_no_fault_of_the_muscles(chain):
    """The process stands still after it has looked at the clocks, and before it reads the bus."""

    def reasons() -> list[str]:
        began = chain.now, chain.wall
        chain.driver_runs = False
        chain.wait(5.0)
        chain.driver.cycle(*began, lambda: (chain.now, chain.wall))
        return [fault.kind for fault in chain.driver.faults]

    first, *others = in_a_fork(reasons)
    assert first == "driver_paused"
    assert "pressure_implausible" not in others
