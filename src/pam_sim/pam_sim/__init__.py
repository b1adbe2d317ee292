"""A simulated rig with valve boards on a CAN bus, and faults that can be injected into it.

The public names, without ROS:

- `SimulatedRig`: plant, sensors and boards; receives and sends frames.
- `RigLoop`: runs a simulated rig in real time on a bus.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pam_sim.rig_loop import RigLoop
    from pam_sim.simulated_rig import SimulatedRig

__all__ = [
    "RigLoop",
    "SimulatedRig",
]


def __getattr__(name: str) -> Any:
    """Import a public name."""
    match name:
        case "__version__":
            from pam_ros.version import installed_version

            return installed_version(__name__)
        case "RigLoop":
            from pam_sim import rig_loop

            return getattr(rig_loop, name)
        case "SimulatedRig":
            from pam_sim import simulated_rig

            return getattr(simulated_rig, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, including those that have not been imported yet."""
    return sorted({*globals(), *__all__})
