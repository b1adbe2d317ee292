"""The force model of a muscle in the compiled plant: a closed form, or a table of samples.

The plant holds the formula of the braided cylinder, with a wall of constant thickness or a factor
on its contraction ratio. Any other registered model is sampled over length: its volume and, at
several pressures, its pull, each as a cubic spline. Between these pressures the interpolation is
linear, which is exact for a model that is affine in pressure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from pam_model.errors import DomainError
from pam_model.muscles.force_model import AffineForceModel, ForceModel, MuscleGeometry
from pam_model.rig import Muscle

Table = npt.NDArray[np.float64]

NO_TABLE: Table = np.zeros((3, 4))
LENGTHS = 129
PRESSURES = 161
DOMAIN_MARGIN = 1e-3  # of the length range: models may be singular at its ends


def closed_form(
    model: str, geometry: MuscleGeometry, constants: Mapping[str, float]
) -> tuple[float, float] | None:
    """Wall thickness [m] and contraction factor of a model's closed form; None if it has none."""
    if model == "gaylord":
        return 0.0, 1.0
    if model == "chou_hannaford":
        return geometry.wall_thickness, 1.0
    if model == "tondu_lopez":
        return 0.0, float(constants.get("k", 1.0))
    return None


def make_table(muscle: Muscle, supply_pressure: float) -> tuple[Table, tuple[float, float], float]:
    """Sample a muscle's force model.

    Returns
    -------
    table : (2 + n_pressures - 1, 2 n_lengths) array
        Row 0 is the gas volume without dead volume [m^3], row 1 + i the pull [N] at i pressure
        steps. Each row holds pairs of value and slope times length step.
    bounds : pair of float
        First and last length [m].
    pressure_step : float
        [Pa].
    """
    model = muscle.create_force_model()
    bounds = model.length_bounds
    high_pressure = 1.1 * supply_pressure
    low = _last_answer(model, high_pressure, muscle, max(bounds[0], 0.3 * muscle.rest_length))
    high = _last_answer(model, high_pressure, muscle, min(bounds[1], 2.0 * muscle.rest_length))
    margin = DOMAIN_MARGIN * (high - low)
    lengths = np.linspace(low + margin, high - margin, LENGTHS)
    affine = isinstance(model, AffineForceModel)
    count = 2 if affine else PRESSURES
    pressure_step = high_pressure / (count - 1)
    rows = [np.asarray(model.volume(lengths), dtype=float)]
    rows += [_pull(model, i * pressure_step, lengths) for i in range(count)]
    step = lengths[1] - lengths[0]
    from scipy.interpolate import CubicSpline  # noqa: PLC0415  (slow to import, seldom needed)

    table = np.empty((len(rows), 2 * LENGTHS))
    for i, row in enumerate(rows):
        table[i, 0::2] = row
        table[i, 1::2] = CubicSpline(lengths, row)(lengths, 1) * step
    return table, (float(lengths[0]), float(lengths[-1])), pressure_step


def _last_answer(model: ForceModel, pressure: float, muscle: Muscle, end: float) -> float:
    """The length nearest to `end` at which the model can still be evaluated [m].

    The domain of some models is smaller than their stated bounds, due to a wall or a fitting.
    """

    def answers(length: float) -> bool:
        try:
            values = (
                model.force(0.0, length),
                model.force(pressure, length),
                model.volume(length),
            )
        except DomainError:
            return False
        return all(math.isfinite(value) for value in values)

    inside, outside = muscle.neutral_length, end
    if answers(end):
        return end
    for _ in range(40):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if answers(middle) else (inside, middle)
    return inside


def _pull(model: ForceModel, pressure: float, lengths: Table) -> Table:
    return np.broadcast_to(np.asarray(model.force(pressure, lengths), dtype=float), lengths.shape)
