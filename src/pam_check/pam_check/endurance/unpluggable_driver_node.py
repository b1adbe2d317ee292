"""The driver on a multicast bus that can be unplugged, for tests of what it does then.

`PAM_UNPLUGGED=/tmp/plug python -m pam_check.endurance.unpluggable_driver_node --ros-args ...` is
the driver's node. While the file holds the number of a system error, python-can raises it from
every call, as SocketCAN does: ENETDOWN (100) for an interface that is set down, ENODEV (19) for an
adapter that is pulled out, which also cannot be opened then.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, Final

import can
from can.interfaces import BACKENDS
from can.interfaces.udp_multicast import UdpMulticastBus

from pam_driver import driver_node

PLUG: Final = "PAM_UNPLUGGED"  # environment variable: path of the file


def failure() -> int:
    """The error of the moment, 0 for a bus that works."""
    path = os.environ.get(PLUG)
    try:
        return int(Path(path).read_text()) if path else 0
    except (OSError, ValueError):
        return 0


class UnpluggableBus(UdpMulticastBus):
    """A multicast bus that fails as an interface does that is gone."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        number = failure()
        if number:
            # what python-can's own constructor would have set, for its destructor
            self._is_shutdown = True
            raise can.CanInitializationError(os.strerror(number), number)
        super().__init__(*arguments, **options)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        _raise_failure()
        return super()._recv_internal(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send, or raise what the file says."""
        _raise_failure()
        super().send(msg, timeout)


def _raise_failure() -> None:
    number = failure()
    if number:
        raise can.CanOperationError(os.strerror(number), number)


def main() -> int:
    """Run the driver's node on such a bus."""
    BACKENDS["udp_multicast"] = (__name__, UnpluggableBus.__name__)
    return driver_node.main()


if __name__ == "__main__":
    sys.exit(main())
