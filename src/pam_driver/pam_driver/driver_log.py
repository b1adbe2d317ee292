"""What the driver's node writes to its log: start, faults, and what ends it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pam_driver.boards.weaker_promises import weaker_promises
from pam_driver.driver import Driver
from pam_driver.start_up import Advice
from pam_ros.unforeseen import tell_unforeseen


class DriverLog:
    """The lines about start and faults.

    Parameters
    ----------
    logger
        Of the node.
    name : str
        Of the node, with its namespace.
    """

    def __init__(self, logger: Any, name: str) -> None:
        self._logger = logger
        self._to_move = f"ros2 lifecycle set {name} activate"
        self._fault_reported = False

    def measuring(self, driver: Driver, ports: Iterable[str], doubts: Iterable[str]) -> None:
        """The bus is open; what its boards promise less than ours."""
        self._logger.info(f"measuring on {', '.join(ports)}, valves vented")
        for line in doubts:
            self._logger.warning(line)
        for board in driver.boards.values():
            for line in weaker_promises(board):
                self._logger.warning(f"{board.name}: {line}")

    def faults(self, driver: Driver) -> None:
        """The faults that are latched, once."""
        if self._fault_reported:
            return
        self._fault_reported = True
        reasons = "; ".join(str(fault) for fault in driver.faults)
        done = "lowering" if driver.lowers else "vented"
        self._logger.error(f"{done}, latched until ~/clear_faults: {reasons}")

    def faults_cleared(self) -> None:
        """The next fault is a new one."""
        self._fault_reported = False

    def broken(self, error: Exception, *, lowers: bool) -> None:
        """The exception that ends the driver; the fault that it leaves is not reported again."""
        self._fault_reported = True
        done = "lowering, then the driver ends" if lowers else "vented, the driver ends"
        tell_unforeseen(self._logger, error, done)

    def start(self, advice: Advice, reason: str) -> None:
        """What is lacking while the node starts."""
        if advice is Advice.READY:
            self._logger.info(f"all boards answer, valves vented; to move: {self._to_move}")
        elif advice is Advice.CANCELLED:
            self.start_cancelled(reason)
        elif advice is Advice.GIVE_UP:
            self._logger.error(f"not activated: {reason}; when this is repaired: {self._to_move}")

    def start_cancelled(self, reason: str) -> None:
        """Somebody did something else first."""
        self._logger.warning(f"the activation at start-up is cancelled by {reason}")
