"""One kind of fault as data: what happens, who detects it, what must follow, and how soon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.stop_categories import BRAKING_TIME
from pam_sim.fault_injection import FAULTS

_S: Final = DriverSettings()
WATCHDOG: Final = 0.1  # s, WatchdogTimeout in the DBC
# From detection to vented valves: a cycle of the driver, a frame and a turn of the board, each
# counted twice as a margin [s].
VENT: Final = 0.012
COMMANDS_STOP: Final = _S.command_timeout + VENT
BRAKING: Final = BRAKING_TIME
LOWERING: Final = _S.lowering_timeout
SENSOR_STOPS: Final = _S.sensor_timeout + VENT
BOARD_HEARS_NOTHING: Final = WATCHDOG + 0.010
WATCH: Final = 1.0  # s, observation of a fault that need not vent


class Reaction(Enum):
    """The required reaction to a fault; tables show the value."""

    VENT = "vents, latched"
    LOWER = "lowers, then vents"
    RIDE = "continues, counted"
    WARN = "continues, warns"
    EITHER = "continues or vents"
    NOTICED = "warns or vents"


STOPS: Final = frozenset({Reaction.VENT, Reaction.LOWER})
"""Reactions after which nothing moves without an act of the operator."""


class Stays(Enum):
    """How far a joint may be from its reference while air moves; pages show the value."""

    NEAR = "0.1 rad"
    TRACKING = "max_tracking_error"
    IN_LIMITS = "position_limits"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind of fault.

    Attributes
    ----------
    name, layer, text : str
        Identifier; where it happens; what happens.
    parameters : mapping of str to (low, high)
        Ranges from which values are drawn uniformly, SI units.
    detected_by : tuple of str
        What may detect it: conditions and counters of the driver, faults of a board, kinds of
        refused commands, "controller".
    reaction : Reaction
        The required reaction.
    bound : float
        Largest time from the fault to vented valves, or to the beginning of the lowering [s]; if
        the fault must not stop the joint, how long the trial observes.
    reason : str
        What determines this bound, or why the fault cannot be detected.
    bounds_driver : bool
        Whether the bound applies to the stop of the driver, since no frame can move the valves.
    stays : Stays
        How far the joint may be from its reference while air moves, unless the fault must vent.
    keeps_air : bool
        Whether a muscle may keep its air, since no valve of it opens to ambient.
    boards : tuple of str
        The kinds of board that can have this fault; empty for faults that are stated for the board
        of this project.
    message : str
        Regular expression that a message of the driver must contain; it names device and object.
    air_drives : bool
        Whether the joint may exceed `max_velocity`, as far as air drives it although the driver
        does all that it may.
    """

    name: str
    layer: str
    text: str
    parameters: Mapping[str, tuple[float, float]]
    detected_by: tuple[str, ...]
    reaction: Reaction
    bound: float
    reason: str = ""
    bounds_driver: bool = False
    stays: Stays = Stays.NEAR
    keeps_air: bool = False
    boards: tuple[str, ...] = ()
    message: str = ""
    air_drives: bool = False


def of_rig(name: str, layer: str, text: str, *rest: Any, **more: Any) -> FaultKind:
    """A kind that the simulated rig brings about; its parameters are in `pam_sim`."""
    return FaultKind(name, layer, text, FAULTS[name].ranges, *rest, **more)
