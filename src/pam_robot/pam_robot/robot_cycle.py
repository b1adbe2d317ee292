"""The cycle of one robot: measure, judge, control, send, and then tell the observers.

One thread does all of it at the rate of the driver (the pattern of ros2_control's controller
manager). The driver begins and ends the cycle, since it decides what may be sent. While it has no
bus open, controller and model run without measurements, as they would in processes of their own.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final, NamedTuple

from pam_driver.snapshot import Snapshot
from pam_ros.errors import ParameterError
from pam_ros.periodic import LoopStatistics, PeriodicLoop

Step = Callable[[float], object]
DRIVER, CONTROLLER = "driver", "controller"
_EQUAL: Final = 1e-6  # rates that differ by less are meant to be equal, relative


class Work(NamedTuple):
    """What is done in a cycle beside the driver's own part."""

    measure: Callable[[Snapshot], object]  # hands what the driver has measured to the controller
    control: Callable[[], object]  # computes commands, and hands them to the driver
    publish: Callable[[], object]  # tells the observers of it, when the commands have been sent
    # estimates what is not measured, from the last measurements or None, and publishes it
    estimate: Callable[[Snapshot | None], object]


def cycles_between(name: str, rate: float, driver_rate: float) -> int:
    """The number of cycles of the driver in one of the controller.

    Parameters
    ----------
    name : str
        The parameter that sets the rate of the controller.
    rate, driver_rate : float
        Both rates [Hz].

    Raises
    ------
    ParameterError
        If it is not a whole number.
    """
    count = max(1, round(driver_rate / rate))
    if abs(count * rate - driver_rate) > _EQUAL * driver_rate:
        raise ParameterError(
            f"{name} = {rate:g} Hz: in one process with the driver, its parameter rate "
            f"({driver_rate:g} Hz) must be {name} or a whole multiple of it"
        )
    return count


class LoopShare:
    """The loop of the whole robot, as one of its nodes sees it (`pam_ros.periodic.Loop`).

    Parameters
    ----------
    cycle : RobotCycle
        Runs the loop.
    part : str
        `DRIVER` or `CONTROLLER`.
    step : callable
        The node's part of the cycle; takes the monotonic time [s].
    """

    def __init__(self, cycle: RobotCycle, part: str, step: Step) -> None:
        self._cycle, self._part, self._step = cycle, part, step

    @property
    def period(self) -> float:
        """Time between two cycles [s]."""
        return self._cycle.loop.period

    @property
    def running(self) -> bool:
        """Whether this part is run."""
        return self._cycle.loop.running and self._cycle.has(self._part)

    @property
    def busy(self) -> bool:
        """Whether a cycle is in progress."""
        return self._cycle.loop.busy

    @property
    def statistics(self) -> LoopStatistics:
        """The timing of the loop since its start."""
        return self._cycle.loop.statistics

    def start(self) -> None:
        """Run this part from the next cycle on."""
        self._cycle.join(self._part, self._step)

    def stop(self, timeout: float = 2.0) -> None:
        """Run this part no more; its cycle in progress has ended when this returns.

        Raises
        ------
        TimeoutError
            If the cycle in progress does not end in time [s].
        """
        self._cycle.leave(self._part, timeout)

    def check(self) -> None:
        """Raise the exception that ended the loop, if there was one."""
        self._cycle.loop.check()

    def shift(self, seconds: float) -> None:
        """Move all later cycles by this time [s]; for use in a cycle."""
        self._cycle.loop.shift(seconds)

    def share_priority(self) -> None:
        """Give the other threads of this process a real-time priority too, if the loop has one."""
        self._cycle.loop.share_priority()


class RobotCycle:
    """Runs the parts of one robot in one thread.

    Attributes
    ----------
    loop : PeriodicLoop
        The thread, from `compose` on.
    """

    def __init__(self) -> None:
        self.loop: PeriodicLoop
        self._turn = threading.Lock()  # held by the cycle, so that a part ends between two cycles
        self._parts: dict[str, Step] = {}
        self._work: Work
        self._control_every = self._estimate_every = 1
        self._cycles = 0
        self._snapshot: Snapshot | None = None
        self._broken = False
        self._controlled = False  # in this cycle
        self._break_down: Callable[[Exception], object]

    def compose(
        self,
        work: Work,
        *,
        rates: tuple[float, float, float],
        priority: int,
        break_down: Callable[[Exception], object],
    ) -> None:
        """Make the loop of all parts.

        Parameters
        ----------
        work : Work
            The parts of controller and model.
        rates : tuple of float
            Of driver, controller and estimates [Hz].
        priority : int
            Requested real-time priority, see `PeriodicLoop`.
        break_down : callable
            Takes an exception outside of the driver's part: the robot must stop.

        Raises
        ------
        ParameterError
            If the rate of the controller does not fit to that of the driver.
        """
        driver_rate, control_rate, model_rate = rates
        self._control_every = cycles_between("loop.rate", control_rate, driver_rate)
        self._estimate_every = max(1, round(driver_rate / model_rate))
        self._work, self._break_down = work, break_down
        self.loop = PeriodicLoop(self._step, 1.0 / driver_rate, "robot", priority)

    def driver_loop(self, step: Step, period: float, name: str, priority: int) -> LoopShare:
        """The driver's share (`pam_ros.periodic.MakeLoop`)."""
        return LoopShare(self, DRIVER, step)

    def controller_loop(self, step: Step, period: float, name: str, priority: int) -> LoopShare:
        """The controller's share (`pam_ros.periodic.MakeLoop`)."""
        return LoopShare(self, CONTROLLER, step)

    def has(self, part: str) -> bool:
        """Whether a part is run."""
        return part in self._parts

    def join(self, part: str, step: Step) -> None:
        """Run a part from the next cycle on."""
        with self._turn:
            self._parts[part] = step

    def leave(self, part: str, timeout: float) -> None:
        """Run a part no more, from the next cycle on.

        Raises
        ------
        TimeoutError
            If the cycle in progress does not end in time [s].
        """
        self._parts.pop(part, None)
        if not self._turn.acquire(timeout=timeout):
            raise TimeoutError(f"the cycle of the robot did not end within {timeout:g} s")
        self._turn.release()

    def control(self, snapshot: Snapshot) -> None:
        """Called in the driver's part, between measuring and sending."""
        self._snapshot = snapshot
        self._work.measure(snapshot)
        self._control()

    def _control(self) -> None:
        if CONTROLLER not in self._parts or self._cycles % self._control_every:
            return
        self._controlled = True
        try:
            self._work.control()
        except Exception:
            self._broken = True  # a controller that has failed is not asked again
            self._parts.pop(CONTROLLER, None)
            raise

    def _step(self, now: float) -> None:
        with self._turn:
            drive = self._parts.get(DRIVER)
            try:
                if drive is not None:
                    drive(now)  # guards itself
                else:
                    self._control()
            except Exception as error:
                self._break_down(error)
        self._cycles += 1
        if not self._broken:
            try:
                self._tell()
            except Exception as error:
                self._broken = True
                self._break_down(error)

    def _tell(self) -> None:
        if self._controlled:
            self._controlled = False
            self._work.publish()
        if self._cycles % self._estimate_every == 0:
            snapshot, self._snapshot = self._snapshot, None
            self._work.estimate(snapshot)
