"""The driver's parameters: limits and time-outs, with units, ranges and texts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DriverSettings:
    """What decides when the driver vents, and how it differentiates angles.

    Attributes
    ----------
    command_timeout : float
        A valve command older than this ends in a latched vent [s].
    sensor_timeout : float
        A pressure or angle older than this is NaN, and a fault while air may move [s].
    board_timeout : float
        A board that sends no measurement, status or heartbeat for so long is lost [s].
    over_pressure_margin : float
        How far above `max_pressure` one sample may lie, for noise [Pa].
    velocity_bandwidth : float
        -3 dB frequency of the differentiated joint angle [Hz].
    """

    command_timeout: float = 0.1
    sensor_timeout: float = 0.05
    board_timeout: float = 0.5
    over_pressure_margin: float = 5000.0
    velocity_bandwidth: float = 40.0
