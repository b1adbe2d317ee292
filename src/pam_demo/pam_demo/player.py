"""What the demo asks of the one who plays its motions; `player_node` is the one that speaks ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Final, Protocol

from pam_demo.motions import Motion
from pam_model.errors import PamError

TAIL: Final = 0.3  # s, recorded after a motion's end


class VentedError(PamError):
    """The driver has vented by itself; the message has its reason."""


class Player(Protocol):
    """Commands driver and controller; each `check` is called often and raises to stop."""

    def wait_for_driver(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until the driver has heard every board and lets valves move."""
        ...

    def wait_for_controller(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until a controller listens and follows a reference."""
        ...

    def vent(self, check: Callable[[], None]) -> None:
        """Tell the driver to vent, as it must be before its commands may stop."""
        ...

    def clear_faults(self, check: Callable[[], None]) -> None:
        """Tell the driver to forget why it vented."""
        ...

    def activate(self, check: Callable[[], None]) -> None:
        """Tell the driver that valves may move again."""
        ...

    def play(
        self, motion: Motion, check: Callable[[], None], progress: Callable[[float], None]
    ) -> float:
        """Play a motion to its end; when its first waypoint was due [s since the epoch]."""
        ...


OpenPlayer = Callable[[tuple[str, ...], Mapping[str, str]], AbstractContextManager[Player]]
"""Makes the player of these joints in the ROS domain of this environment."""
