"""The driver's limits and time-outs, with units and defaults: most are parameters of its node."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from pam_model.bounds import check_numbers
from pam_ros.parameter_row import declared, declared_rows


@dataclass(frozen=True, slots=True)
class DriverSettings:
    """The settings that decide when the driver vents, and how it differentiates angles.

    Attributes
    ----------
    period : float
        Time between two cycles [s].
    others
        The parameters of the node of these names, which are declared here.

    Raises
    ------
    PamError
        For a number that is not finite or below 0, or a period outside 0.1 ms to 1 s.
    """

    command_timeout: float = declared(
        0.1, "s", 0.005, 1.0, "a valve command older than this causes a latched vent"
    )
    sensor_timeout: float = declared(
        0.05, "s", 0.005, 1.0, "a pressure or angle older than this counts as missing, and causes "
        "a latched vent while air may move"
    )  # fmt: skip
    board_timeout: float = declared(
        0.5, "s", 0.15, 5.0, "a board that sends nothing for longer counts as lost"
    )
    over_pressure_margin: float = declared(
        5000.0, "Pa", 0.0, 100_000.0, "how far a sample may exceed max_pressure, as an allowance "
        "for noise"
    )  # fmt: skip
    velocity_bandwidth: float = declared(
        40.0, "Hz", 1.0, 500.0, "-3 dB frequency of the low pass for the differentiated joint angle"
    )
    # a thirtieth of the highest pressure of the example rigs: two muscles cannot lift their joint
    vented_pressure: float = declared(
        20e3, "Pa", 1e3, 200e3, "a muscle counts as empty below this gauge pressure; the driver is "
        "vented when all muscles are"
    )  # fmt: skip
    exhaust_timeout: float = declared(
        0.0, "s", 0.0, 600.0, "a muscle that is not empty so long after its valve began to vent is "
        "a fault; 0: four times the ideal time from the rig's volumes and conductances, plus one "
        "second"
    )  # fmt: skip
    loop_delay_limit: float = declared(
        0.01, "s", 0.001, 1.0, "largest delay of commands and measurements around the loop beyond "
        "three cycles; above it the driver vents"
    )  # fmt: skip
    period: float = 0.002
    lowering_speed: float = declared(
        0.5, "rad/s", 0.05, 5.0, "speed with which a stop of category 1 lets a loaded joint sink"
    )
    lowering_timeout: float = declared(
        4.0, "s", 0.0, 60.0, "a stop of category 1 that is not finished after this time ends in a "
        "vent; 0: every stop vents at once"
    )  # fmt: skip
    start_up_check: bool = declared(
        False, "-", 0, 1, "an activation first tests every valve and sensor with small pulses of "
        "air; robot.launch.py asks for it"
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse numbers without a meaning."""
        check_numbers(self, "DriverSettings", NUMBERS)


NUMBERS: Final = {
    row.name: (0.0, math.inf, row.unit)
    for row in declared_rows(DriverSettings)
    if not isinstance(row.default, bool)
} | {"period": (1e-4, 1.0, "s")}
"""Lowest and highest value and unit of each number; the node's parameters have narrower bounds."""
