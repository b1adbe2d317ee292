"""Sizes of muscles that can be bought, with what their maker publishes.

Source: Festo, catalogue "Fluidic Muscle DMSP/MAS": inner diameter, largest operating pressure, and
the theoretical force at that pressure without contraction. The catalogue also allows a contraction
of at most 25 % of the nominal length. The angle of the threads is not published; it follows from
the force of an ideal braid, see `BraidFromDatasheet.of_force`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from pam_model.errors import PamError
from pam_model.names import unknown


@dataclass(frozen=True, slots=True)
class MuscleSize:
    """One size of a maker."""

    diameter: float  # inner diameter [m]
    force: float  # theoretical force at `pressure`, without contraction [N]
    pressure: float  # largest operating pressure [Pa gauge]
    contraction: float  # largest permitted contraction over nominal length [-]


_FESTO = {
    "10": MuscleSize(0.010, 630.0, 8e5, 0.25),
    "20": MuscleSize(0.020, 1500.0, 6e5, 0.25),
    "40": MuscleSize(0.040, 6000.0, 6e5, 0.25),
}
SIZES = {f"{series}-{size}": entry for series in ("DMSP", "MAS") for size, entry in _FESTO.items()}
"""The sizes by name."""
_ORDER_CODE: Final = re.compile(r"([A-Z]+)[-_ ]?(\d+)(?:[-_ ].*)?")  # such as DMSP-20-250N-RM-CM


def size_name(text: str) -> str:
    """The name of a size as `SIZES` has it, from the maker's order code in any case.

    Parameters
    ----------
    text : str
        Such as "DMSP-20", "dmsp20" or "MAS-20-300N-AA-MC-K"; what follows the size is ignored.

    Raises
    ------
    PamError
        For another size; the message names those that are known.
    """
    code = _ORDER_CODE.fullmatch(text.strip().upper())
    name = f"{code[1]}-{code[2]}" if code else text
    if name not in SIZES:
        raise PamError(
            f"{unknown('muscle size', text, SIZES)}; for another muscle, state its diameter and "
            "the angle of its threads"
        )
    return name
