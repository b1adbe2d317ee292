"""A multicast bus that can be unplugged, to test the driver without a bus.

It is an interface of python-can with the name INTERFACE, which python-can finds as a plug-in
(`can.interface` in this package's setup.py), so that the normal driver program can use it:
`PAM_UNPLUGGED=/tmp/plug pam driver node --ros-args -p bus.interface:=unpluggable
-p bus.channel:=239.74.163.2 -p bus.options:=port=43113 ...`. While the file contains the number of
a system error, every call raises this error, as SocketCAN does: ENETDOWN (100) for an interface
that is set down, ENODEV (19) for an adapter that is unplugged and cannot be opened again.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final

import can
from can.interfaces.udp_multicast import UdpMulticastBus

from pam_driver.can_bus.bus_opening import hear_own_group_only

INTERFACE: Final = "unpluggable"
PLUG: Final = "PAM_UNPLUGGED"  # environment variable: path of the file


def failure() -> int:
    """The present error number; 0 if the bus works."""
    path = os.environ.get(PLUG)
    try:
        return int(Path(path).read_text()) if path else 0
    except (OSError, ValueError):
        return 0


class UnpluggableBus(UdpMulticastBus):
    """A multicast bus on this machine that can fail like a missing interface."""

    def __init__(self, channel: str, port: int, **_: Any) -> None:
        number = failure()
        if number:
            # python-can's destructor needs this attribute, which its constructor would have set
            self._is_shutdown = True
            raise can.CanInitializationError(os.strerror(number), number)
        super().__init__(channel, port, hop_limit=0)
        hear_own_group_only(self)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        _raise_failure()
        return super()._recv_internal(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send, or raise the error in the file."""
        _raise_failure()
        super().send(msg, timeout)


def _raise_failure() -> None:
    number = failure()
    if number:
        raise can.CanOperationError(os.strerror(number), number)
