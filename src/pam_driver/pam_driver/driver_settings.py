"""The driver's limits and time-outs, with units and defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from pam_model.bounds import check_numbers

NUMBERS: Final = {
    name: (0.0, math.inf, unit)
    for name, unit in (
        ("command_timeout", "s"),
        ("sensor_timeout", "s"),
        ("board_timeout", "s"),
        ("over_pressure_margin", "Pa"),
        ("velocity_bandwidth", "Hz"),
        ("vented_pressure", "Pa"),
        ("exhaust_timeout", "s"),
        ("loop_delay_limit", "s"),
        ("lowering_speed", "rad/s"),
        ("lowering_timeout", "s"),
    )
} | {"period": (1e-4, 1.0, "s")}
"""Lowest and highest value and unit of each number; the node's parameters have narrower bounds."""


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
        A board that sends no measurement, no status or no heartbeat for this time counts as lost
        [s].
    over_pressure_margin : float
        How far one sample may exceed `max_pressure`, as an allowance for noise [Pa].
    velocity_bandwidth : float
        -3 dB frequency of the differentiated joint angle [Hz].
    vented_pressure : float
        A muscle counts as empty below this pressure [Pa gauge]. At 20 kPa, a thirtieth of the
        highest pressure of the example rigs, two muscles can no longer lift their joint.
    exhaust_timeout : float
        A muscle that is not empty after this time of venting has a blocked exhaust [s]; 0: from the
        rig's volumes and conductances, see `safety.exhaust_watch`.
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
        For a number that is not finite or below 0, or a period outside 0.1 ms to 1 s.
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
        """Refuse numbers without a meaning."""
        check_numbers(self, "DriverSettings", NUMBERS)
