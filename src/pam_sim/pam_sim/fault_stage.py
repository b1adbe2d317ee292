"""The objects on which faults of the rig act, and what brings a fault about."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from typing import Final, Protocol

from pam_sim.faults.frame_faults import FrameFaults
from pam_sim.simulated_rig import SimulatedRig

Values = Mapping[str, float]
FOR_EVER: Final = 1e6  # s


class FaultStage(Protocol):
    """A simulated rig with its bus: the rig's loop in real time, or the chain of the campaign."""

    sim: SimulatedRig
    frames: FrameFaults
    now: float

    def at(self, time: float, action: Callable[[], None]) -> None:
        """Call `action` at a time [s]."""


Injection = Callable[[FaultStage, Values, random.Random], None]
