"""CAN bus driver for the valve boards of pneumatic artificial muscles.

The public names, without ROS:

- `Driver`, `DriverSettings`: boards, safety and commands of one rig, in periodic cycles.
- `open_bus`, `CanPort`: a CAN bus that neither blocks nor raises once it is open.

Everywhere in this package, `now` is a monotonic time [s].

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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


def __getattr__(name: str) -> Any:
    """Import a public name."""
    match name:
        case "__version__":
            from pam_ros.version import installed_version

            return installed_version(__name__)
        case "CanPort" | "open_bus":
            from pam_driver.can_bus import bus

            return getattr(bus, name)
        case "Driver":
            from pam_driver.driver import Driver

            return Driver
        case "DriverSettings":
            from pam_driver.driver_settings import DriverSettings

            return DriverSettings
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, including those that have not been imported yet."""
    return sorted({*globals(), *__all__})
