"""The driver's limits and time-outs, with units and defaults."""

from __future__ import annotations

from dataclasses import dataclass


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
    """

    command_timeout: float = 0.1
    sensor_timeout: float = 0.05
    board_timeout: float = 0.5
    over_pressure_margin: float = 5000.0
    velocity_bandwidth: float = 40.0
