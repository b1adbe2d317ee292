"""The row of each joint that says what a cycle has done: what the guard judges and others show."""

from __future__ import annotations

from typing import Final

(Z_REFERENCE, Z_REFERENCE_SPEED, Z_REFERENCE_PUSH, Z_POSITION, Z_SPEED, Z_TIME, Z_ERROR, Z_TORQUE,
 Z_STIFFNESS, Z_TORQUE_REACHED, Z_STIFFNESS_REACHED, Z_TRUE_STIFFNESS, Z_DISTURBANCE, Z_UNEXPLAINED,
 Z_YIELDS, Z_DRIVEN, Z_TORQUE_CUT, Z_STIFFNESS_CUT, Z_RATE_CUT, Z_VALVE_CUT,
 Z_TUBES) = range(21)  # fmt: skip
Z_PRESSURES: Final = 21
"""Reference of the position at the time of measurement, and its derivatives; measured position
[rad], speed [rad/s] and time [s]; error [rad]; what the law says (`LawTelemetry`); what was
limited; number of muscles that were found to be behind a tube; desired pressures of the muscles
[Pa]."""
