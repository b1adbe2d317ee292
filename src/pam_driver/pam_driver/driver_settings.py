"""The driver's limits and time-outs, with units and defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pam_model.bounds import check_numbers

BOUNDS: Final = {
    "command_timeout": (0.005, 1.0, "s"),
    "sensor_timeout": (0.005, 1.0, "s"),
    "board_timeout": (0.15, 5.0, "s"),
    "over_pressure_margin": (0.0, 100e3, "Pa"),
    "velocity_bandwidth": (1.0, 500.0, "Hz"),
    "vented_pressure": (1e3, 200e3, "Pa"),
    "exhaust_timeout": (0.0, 600.0, "s"),
    "loop_delay_limit": (0.001, 1.0, "s"),
    "period": (0.001, 1.0, "s"),
    "lowering_speed": (0.05, 5.0, "rad/s"),
    "lowering_timeout": (0.0, 60.0, "s"),
}
"""Lowest and highest value and unit of each number, as the parameters of the node have them."""


@dataclass(frozen=True, slots=True)
class DriverSettings:
    """The settings that decide when the driver vents, and how it differentiates angles.

    Attributes
    ----------
    command_timeout : float
        A valve command older than this causes a latched vent [s].
    sensor_timeout : float
        A pressure or angle older than this is NaN, and a fault while air may move [s].
    board_timeout : float
        A board that sends no measurement, no status or no heartbeat for so long counts as lost [s].
    over_pressure_margin : float
        How far one sample may exceed `max_pressure`, as an allowance for noise [Pa].
    velocity_bandwidth : float
        -3 dB frequency of the differentiated joint angle [Hz].
    vented_pressure : float
        A muscle counts as empty below this pressure [Pa gauge]. At 20 kPa, a thirtieth of the
        highest pressure of the example rigs, two muscles can no longer lift their joint.
    exhaust_timeout : float
        A muscle that is not empty so long after its valve began to vent has a blocked exhaust [s];
        0: from the rig's volumes and conductances, see `safety.exhaust_watch`.
    loop_delay_limit : float
        Largest delay of the loop beyond three cycles, see `safety.loop_watch` [s].
    period : float
        Time between two cycles [s].
    lowering_speed : float
        Speed with which a stop of category 1 lets a loaded joint sink [rad/s].
    lowering_timeout : float
        A stop of category 1 that is not finished after this time ends in a vent [s]; 0 makes every
        stop one of category 0.
    start_up_check : bool
        An activation first tests every valve and sensor with small pulses of air.

    Raises
    ------
    PamError
        For a number outside its `BOUNDS`.
    """

    command_timeout: float = 0.1
    sensor_timeout: float = 0.05
    board_timeout: float = 0.5
    over_pressure_margin: float = 5000.0
    velocity_bandwidth: float = 40.0
    vented_pressure: float = 20e3
    exhaust_timeout: float = 0.0
    loop_delay_limit: float = 0.01
    period: float = 0.002
    lowering_speed: float = 0.5
    lowering_timeout: float = 4.0
    start_up_check: bool = False

    def __post_init__(self) -> None:
        """Refuse a number that the node would refuse."""
        check_numbers(self, "DriverSettings", BOUNDS)
