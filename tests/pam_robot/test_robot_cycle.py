"""The order of a robot's cycle, and what an exception or an end in it does; nothing runs."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from pam_robot.robot_cycle import RobotCycle, Work, cycles_between
from pam_ros.errors import ParameterError

SNAPSHOT: Any = SimpleNamespace(pressures=(1e5, 2e5))


class Bench:
    """A cycle whose parts note what they do."""

    def __init__(self, rates: tuple[float, float, float] = (500.0, 500.0, 500.0)) -> None:
        self.log: list[str] = []
        self.broken: list[Exception] = []
        self.failing: dict[str, Exception] = {}
        self.cycle = RobotCycle()
        self.driver = self.cycle.driver_loop(self.drive, 0.002, "bus I/O", 0)
        self.controller = self.cycle.controller_loop(lambda _: None, 0.002, "control", 0)
        work = Work(
            lambda snapshot: self.do("measured"),
            lambda: self.do("control"),
            lambda: self.do("published"),
            lambda snapshot: self.do("estimated" if snapshot else "estimated from nothing"),
        )
        self.cycle.compose(work, rates=rates, priority=0, break_down=self.broken.append)
        self.controller.start()

    def do(self, what: str) -> None:
        self.log.append(what)
        if what in self.failing:
            raise self.failing[what]

    def drive(self, now: float) -> None:
        """As `DriverNode._cycle`, which guards itself."""
        self.log.append("read")
        try:
            self.cycle.control(SNAPSHOT)
        except Exception as error:
            self.broken.append(error)
        self.log.append("sent")

    def step(self, times: int = 1) -> list[str]:
        self.log = []
        for _ in range(times):
            self.cycle._step(0.0)
        return self.log


def test_commands_leave_before_anybody_is_told() -> None:
    bench = Bench()
    bench.driver.start()
    assert bench.step() == ["read", "measured", "control", "sent", "published", "estimated"]


def test_without_a_bus_controller_and_model_run_without_measurements() -> None:
    bench = Bench()
    assert bench.step() == ["control", "published", "estimated from nothing"]
    bench.driver.start()
    bench.step()
    bench.driver.stop()
    assert bench.step() == ["control", "published", "estimated from nothing"]


def test_the_controller_and_the_model_may_have_a_part_of_the_rate() -> None:
    bench = Bench((500.0, 250.0, 100.0))
    bench.driver.start()
    log = bench.step(20)
    counted = [log.count(one) for one in ("sent", "control", "published", "estimated")]
    assert counted == [20, 10, 10, 4]
    assert log.count("measured") == 20


@pytest.mark.parametrize("rate", [300.0, 499.0, 700.0, 1000.0])
def test_a_rate_that_does_not_fit_is_refused_by_its_name(rate: float) -> None:
    with pytest.raises(ParameterError, match=rf"loop.rate = {rate:g} Hz.*\(500 Hz\) must be"):
        Bench((500.0, rate, 100.0))


@pytest.mark.parametrize(("rate", "count"), [(500.0, 1), (250.0, 2), (125.0, 4), (500.0 / 3, 3)])
def test_a_rate_that_fits_is_a_number_of_cycles(rate: float, count: int) -> None:
    assert cycles_between("loop.rate", rate, 500.0) == count


def test_a_controller_that_fails_stops_the_robot_and_is_not_asked_again() -> None:
    """The driver goes on, since it lowers the joints."""
    bench = Bench()
    bench.driver.start()
    error = RuntimeError()
    bench.failing["control"] = error
    bench.step()
    assert bench.broken == [error]
    bench.failing = {}
    assert bench.step(2) == ["read", "measured", "sent"] * 2
    assert bench.broken == [error]


@pytest.mark.parametrize("part", ["control", "published", "estimated from nothing"])
def test_what_fails_outside_of_the_drivers_part_stops_the_robot_once(part: str) -> None:
    bench = Bench()
    error = RuntimeError()
    bench.failing[part] = error
    bench.step(3)
    assert bench.broken == [error]


def test_a_part_has_ended_when_stop_returns() -> None:
    """Else the bus would be closed below it."""
    bench = Bench()
    begun, go_on = threading.Event(), threading.Event()

    def drive(_: float) -> None:
        begun.set()
        assert go_on.wait(30.0)

    bench.cycle.driver_loop(drive, 0.002, "bus I/O", 0).start()
    thread = threading.Thread(target=bench.cycle._step, args=(0.0,))
    thread.start()
    assert begun.wait(30.0)
    with pytest.raises(TimeoutError, match=r"did not end within 0\.01 s"):
        bench.driver.stop(timeout=0.01)
    go_on.set()
    bench.driver.stop(timeout=30.0)
    thread.join(30.0)
    assert not bench.cycle.has("driver")


def test_a_share_tells_of_the_one_loop() -> None:
    bench = Bench()
    assert not bench.controller.running
    bench.cycle.loop.start()
    try:
        assert bench.controller.running
        assert not bench.driver.running
        assert bench.driver.period == bench.controller.period == 0.002
        until = threading.Event()
        while bench.controller.statistics.cycles < 3:
            assert not until.wait(0.001)
            bench.controller.check()
    finally:
        bench.cycle.loop.stop()
    assert bench.driver.statistics == bench.cycle.loop.statistics
