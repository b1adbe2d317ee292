"""What the driver sends on a bus for all its CANopen devices: its heartbeat, and SYNC.

The heartbeat leaves with the driver's cycle and not from a timer of its own, so that a loop that
hangs is noticed by the devices.
"""

from __future__ import annotations

import math
from typing import Final

from pam_driver.boards.canopen.device import OPERATIONAL, SYNC, CanopenDevice
from pam_driver.boards.protocol import NEVER, Frame

# A heartbeat is sent half a cycle early rather than nearly a cycle late [s].
_EARLY: Final = 0.0005
_HEARTBEAT: Final = bytes([OPERATIONAL])


class Host:
    """The driver as a node on one bus; its boards share it.

    Attributes
    ----------
    period : float
        Time between two heartbeats [s]; infinite if no device needs them.
    sync : bool
        Whether SYNC is sent in every cycle.
    """

    def __init__(self) -> None:
        self.period = math.inf
        self.sync = False
        self._heartbeat_id = 0
        self._due = NEVER
        self._synced_at = NEVER

    def serve(self, device: CanopenDevice) -> None:
        """Take the needs of a further device into account."""
        self.sync = self.sync or device.sync
        if device.host_period is not None:
            self.period = min(self.period, device.host_period)
            self._heartbeat_id = 0x700 + device.host_node

    def frames(self, now: float) -> list[Frame]:
        """The frames that are due at `now` [s], whichever board asks first."""
        frames: list[Frame] = []
        if now >= self._due - _EARLY and self.period < math.inf:
            frames.append((self._heartbeat_id, _HEARTBEAT))
            self._due = max(self._due, now - self.period) + self.period
        if self.sync and now > self._synced_at:
            frames.append((SYNC, b""))
            self._synced_at = now
        return frames
