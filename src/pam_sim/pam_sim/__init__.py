"""A simulated rig with valve boards on a CAN bus, and faults that can be injected into it.

The public names, without ROS:

- `SimulatedRig`: plant, sensors and boards; receives and sends frames.
- `RigLoop`: runs a simulated rig in real time on a bus.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_ros.lazy_names import lazy_names

if TYPE_CHECKING:
    from pam_sim.rig_loop import RigLoop
    from pam_sim.simulated_rig import SimulatedRig

__all__ = [
    "RigLoop",
    "SimulatedRig",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "rig_loop": "RigLoop",
        "simulated_rig": "SimulatedRig",
    },
)
