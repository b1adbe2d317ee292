"""What a rig file says of how well its numbers are known after a calibration."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from pam_gap.calibration.calibration import KEPT, CalibratedNumber
from pam_gap.calibration.free_numbers import BODY, GAS, STATICS, Said
from pam_model.rig import Rig


def as_known(rig: Rig, numbers: Sequence[CalibratedNumber], said: Said) -> Rig:
    """The rig with the tolerances that its calibrated numbers have.

    Each tolerance is that of the number that is known least well, and at most what was said before
    the calibration. A number that no motion determines does not count: nothing shows it.

    Parameters
    ----------
    rig : Rig
        With the calibrated numbers.
    numbers : sequence of CalibratedNumber
        All numbers that were free.
    said : Said
        How far they could be off before.
    """
    if not numbers:
        return rig

    def widest(stages: Collection[str], before: float) -> float:
        known = [
            0.5 * (high - low) / abs(one.value)
            for one in numbers
            for low, high in (one.relative or (one.low, one.high),)
            if one.stage in stages and one.status != KEPT and one.unit != "rad" and one.value
        ]
        return round(min(max(known, default=before), before), 3)

    return replace(
        rig,
        parameter_tolerance=widest((GAS, BODY), said.tolerance),
        length_tolerance=widest((STATICS,), said.lengths),
    )
