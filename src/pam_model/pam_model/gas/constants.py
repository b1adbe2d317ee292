"""Constants of air and of the ISO 6358 reference state (ANR)."""

from __future__ import annotations

from typing import Final

GAS_CONSTANT: Final = 287.05
"""Of air, R [J/(kg K)]."""
HEAT_CAPACITY_RATIO: Final = 1.4
"""Of air [-]."""
REFERENCE_DENSITY: Final = 1.185
"""ANR, 293.15 K and 100 kPa [kg/m^3]."""
REFERENCE_TEMPERATURE: Final = 293.15
"""ANR [K]."""
LINEAR_RATIO: Final = 0.999
"""Above this pressure ratio the flow is a straight line to zero [-]."""
