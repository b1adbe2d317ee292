"""Constants of air and of the ISO 6358 reference state (ANR)."""

from __future__ import annotations

from typing import Final

GAS_CONSTANT: Final = 287.05
"""Specific gas constant R of air [J/(kg K)]."""
HEAT_CAPACITY_RATIO: Final = 1.4
"""Heat capacity ratio of air [-]."""
REFERENCE_DENSITY: Final = 1.185
"""Density rho0 at the reference state ANR, 293.15 K and 100 kPa [kg/m^3]."""
REFERENCE_TEMPERATURE: Final = 293.15
"""ANR [K]."""
LINEAR_RATIO: Final = 0.999
"""Pressure ratio above which the flow falls linearly to zero [-]."""
