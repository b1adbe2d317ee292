"""Interface of the player of the demo's motions; `player_node` implements it with ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Final, Protocol

from pam_demo.motions import DemoMotion
from pam_model.errors import PamError

TAIL: Final = 0.3  # s, recorded after a motion's end


class NotPlayedError(PamError):
    """A motion was not played to its end; the message gives the reason."""


class VentedError(NotPlayedError):
    """The driver has vented by itself; the message gives the reason."""


class Player(Protocol):
    """Commands driver and controller; `check` is called often and raises an error to stop."""

    def wait_for_driver(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until the driver has received data from every board and allows valve motion."""
        ...

    def wait_for_controller(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until a controller is connected and follows a reference."""
        ...

    def vent(self, check: Callable[[], None]) -> None:
        """Make the driver vent, which is necessary before its commands may stop."""
        ...

    def clear_faults(self, check: Callable[[], None]) -> None:
        """Clear the driver's latched faults."""
        ...

    def activate(self, check: Callable[[], None]) -> None:
        """Activate the driver, so that valves may move again."""
        ...

    def start_counting(self) -> None:
        """Count late cycles of the loops of driver and controller from now on."""
        ...

    def late_share(self) -> float:
        """Share of late and skipped cycles since then, of the loop that has more; 1 if unknown."""
        ...

    def play(
        self, motion: DemoMotion, check: Callable[[], None], progress: Callable[[float], None]
    ) -> float:
        """Play a motion to its end; return the time of its first waypoint [s since the epoch]."""
        ...


OpenPlayer = Callable[[tuple[str, ...], Mapping[str, str]], AbstractContextManager[Player]]
"""Creates the player of these joints in the ROS domain of this environment."""
