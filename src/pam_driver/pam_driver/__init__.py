"""CAN bus driver for the valve boards of pneumatic artificial muscles.

The public names, without ROS:

- `Driver`, `DriverSettings`: boards, safety and commands of one rig, in periodic cycles.
- `open_bus`, `CanPort`: a CAN bus that neither blocks nor raises once it is open.

Everywhere in this package, `now` is a monotonic time [s].

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_ros.lazy_names import lazy_names

if TYPE_CHECKING:
    from pam_driver.can_bus.bus import CanPort, open_bus
    from pam_driver.driver import Driver
    from pam_driver.driver_settings import DriverSettings

__all__ = [
    "CanPort",
    "Driver",
    "DriverSettings",
    "open_bus",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "can_bus.bus": "CanPort open_bus",
        "driver": "Driver",
        "driver_settings": "DriverSettings",
    },
)
