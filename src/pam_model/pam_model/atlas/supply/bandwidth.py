"""Bandwidth that valve, tube and dead space permit, and its increase by a filler.

Davis et al. are named without a formula in "A Review of Design and Modeling of Pneumatic
Artificial Muscle" ("400 % more bandwidth" from a filler); derived here from filling and emptying
times. At the same flow the time is proportional to the gas volume, so five times the bandwidth
needs a fifth of the volume, and four times (the other interpretation of 400 %) needs a quarter.
"""

from __future__ import annotations

from dataclasses import dataclass

from pam_model.atlas.supply.fill_time import exhaust_time, fill_time
from pam_model.atlas.supply.tube import StraightTube, series_conductance
from pam_model.domain import require
from pam_model.errors import DomainError


@dataclass(frozen=True, slots=True)
class SupplyLine:
    """A muscle with its valve, tube and unused gas space.

    Raises
    ------
    DomainError
        For a volume below 0 or a filler that leaves no gas volume.
    """

    muscle_volume: float  # gas volume of the muscle at its working length [m^3]
    valve_conductance: float  # ISO 6358 C [m^3/(s Pa)]
    critical_ratio: float = 0.3  # ISO 6358 b of the whole path [-]
    dead_volume: float = 0.0  # gas volume of fittings and other parts besides muscle and tube [m^3]
    # solid or granular filler inside the muscle that reduces the gas volume [m^3]
    filler_volume: float = 0.0
    tube: StraightTube | None = None  # tube between valve and muscle

    def __post_init__(self) -> None:
        require("muscle_volume [m^3]", self.muscle_volume, 0.0, open_low=True)
        require("dead_volume [m^3]", self.dead_volume, 0.0)
        require("filler_volume [m^3]", self.filler_volume, 0.0)
        if self.gas_volume <= 0.0:
            raise DomainError(
                f"filler_volume = {self.filler_volume:g} m^3 leaves no gas in "
                f"{self.gas_volume + self.filler_volume:g} m^3"
            )

    @property
    def gas_volume(self) -> float:
        """Gas volume to fill [m^3]: muscle, tube and dead space minus the filler."""
        tube = self.tube.volume if self.tube else 0.0
        return self.muscle_volume + tube + self.dead_volume - self.filler_volume

    @property
    def conductance(self) -> float:
        """ISO 6358 C of valve and tube in series [m^3/(s Pa)]."""
        if self.tube is None:
            return self.valve_conductance
        return series_conductance([self.valve_conductance, self.tube.conductance])

    def cycle_bandwidth(
        self,
        *,
        supply_pressure: float,
        ambient_pressure: float,
        low_pressure: float,
        high_pressure: float,
    ) -> float:
        """Cycles per second [Hz] between two absolute pressures [Pa]: 1/(filling + emptying).

        The delay of the tube is added once for filling and once for emptying.

        Raises
        ------
        DomainError
            Unless ambient < low < high <= supply.
        """
        require("high_pressure [Pa abs]", high_pressure, low_pressure, open_low=True)
        filling = fill_time(
            self.gas_volume,
            self.conductance,
            self.critical_ratio,
            supply_pressure=supply_pressure,
            start_pressure=low_pressure,
            end_pressure=high_pressure,
        )
        emptying = exhaust_time(
            self.gas_volume,
            self.conductance,
            self.critical_ratio,
            ambient_pressure=ambient_pressure,
            start_pressure=high_pressure,
            end_pressure=low_pressure,
        )
        delay = 2.0 * self.tube.delay if self.tube else 0.0
        return 1.0 / (filling + emptying + delay)
