"""The plants that can make the recordings of a blind check."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

import numpy as np

from pam_check.blind.second_plant import run_second
from pam_check.blind.truth_plant import (
    Array,
    PressureExcitation,
    Sensors,
    SupplyWander,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
    run_truth,
)


class RunPlant(Protocol):
    """Runs a rig through an excitation and records it, as `truth_plant.run_truth` does."""

    def __call__(
        self,
        joint: TruthJoint,
        muscles: tuple[TruthMuscle, TruthMuscle],
        excitation: PressureExcitation,
        sensors: Sensors,
        generator: np.random.Generator,
        *,
        fixed_commands: Array | None = None,
        supply: SupplyWander | None = None,
    ) -> TruthRecording:
        """Record one motion."""
        ...


FIRST: Final = "first"
PLANTS: Final[Mapping[str, RunPlant]] = {FIRST: run_truth, "second": run_second}
"""Same rigs and sizes of effects, other laws."""
