"""The filters and the fit of `stiffness_estimate`, as functions of rows of numbers.

numba compiles these functions with whatever calls them; without numba, the rows are lists.
"""

from __future__ import annotations

from typing import Any, Final

from pam_control.adaptation.fading_sums import add_fading, rms_left
from pam_control.adaptation.normal_equations import CORRELATED, factorise, substitute
from pam_model.plant.compiled import entry_point

FILTER: Final = 0.03  # s, of both filters
SLOWEST: Final = 0.04  # rad/s; friction may be anything in a joint that stands still

# Rows of the filters: as measured, once and twice filtered
MEASURED, ONCE, TWICE, N_FILTERS = range(4)
# Rows of changes: as found, and where the derivatives were taken
FOUND, ABOUT, N_WEIGHTS = range(3)


def _trapezoid(filtered: float, before: float, now: float, step: float) -> float:
    """The filter 1/(T s + 1) after a step [s] between two values of its input."""
    return ((2.0 * FILTER - step) * filtered + step * (before + now)) / (2.0 * FILTER + step)


@entry_point
def take_torques(
    inputs: Any, filters: Any, elapsed: float, inertia: float, damping: float, begins: bool,
    counts: bool, parts: Any, products: Any, targets: Any, totals: Any, load_products: Any,
    load_targets: Any, load_totals: Any,
) -> bool:  # fmt: skip
    """Filter a sample, and add it to the sums if the joint moves; return whether it was added.

    Parameters
    ----------
    inputs : row
        (n,) Torque that the model does not explain, its derivatives by the numbers [N m], slip
        element [-], gravity [N m] and position [rad].
    filters : rows
        (`N_FILTERS`, n), changed.
    elapsed : float
        Time since the last sample [s].
    inertia, damping : float
        Of the joint by the rig file [kg m^2], [N m s/rad].
    begins, counts : bool
        Whether the filters begin with this sample; whether they have settled.
    parts : row
        (n - 1,) scratch: derivatives, inertia, damping, gravity, slip element.
    products, targets, totals
        Sums of all parts but the last (`fading_sums`), changed.
    load_products, load_targets, load_totals
        Sums of all parts, changed.
    """
    measured, once, twice = filters[MEASURED], filters[ONCE], filters[TWICE]
    last = len(inputs) - 1
    for i in range(len(inputs)):
        if begins:
            measured[i] = once[i] = twice[i] = inputs[i]
        before = once[i]
        once[i] = _trapezoid(before, measured[i], inputs[i], elapsed)
        twice[i] = _trapezoid(twice[i], before, once[i], elapsed)
        measured[i] = inputs[i]
    speed = (once[last] - twice[last]) / FILTER
    if begins or not counts or abs(speed) <= SLOWEST:
        return False
    acceleration = (measured[last] - 2.0 * once[last] + twice[last]) / FILTER**2
    count = last - 3  # of the derivatives
    for i in range(count):
        parts[i] = -twice[1 + i]
    parts[count], parts[count + 1] = inertia * acceleration, damping * speed
    parts[count + 2], parts[count + 3] = twice[last - 1], twice[last - 2]
    # muscles + parts * changes = (1 + change) inertia + ... ; what lacks is on the left
    target = twice[0] - parts[count] - parts[count + 1] - parts[count + 2]
    add_fading(load_products, load_targets, load_totals, parts, target, elapsed)
    add_fading(products, targets, totals, parts, target, elapsed)
    return True


@entry_point
def solve_changes(
    products: Any, targets: Any, totals: Any, weights: Any, factor: Any, prior: float,
    noise: float, count: int,
) -> tuple[float, float]:  # fmt: skip
    """Find the changes of the numbers that explain what was seen.

    Parameters
    ----------
    products, targets, totals
        Sums (`fading_sums`).
    weights : rows
        `FOUND` and `ABOUT`, the former is changed.
    factor : matrix
        Becomes the factor of the information about the changes, in its lower triangle.
    prior : float
        Information about each change before anything was seen [-].
    noise : float
        Least root mean square of the errors [N m].
    count : int
        Number of the changes whose derivatives were taken somewhere.

    Returns
    -------
    change, left : float
        Largest distance from where the derivatives were taken [-], and what the fit leaves [N m].
    """
    found, about = weights[FOUND], weights[ABOUT]
    errors = max(noise, rms_left(products, targets, totals, found))
    gain = 1.0 / (CORRELATED * errors * errors)
    for i in range(len(found)):
        for j in range(len(found)):
            factor[i][j] = gain * products[i][j]
        factor[i][i] += prior
        found[i] = gain * targets[i]
    factorise(factor, len(found))
    substitute(factor, len(found), found)
    change = 0.0
    for i in range(count):
        change = max(change, abs(found[i] - about[i]))
    return change, rms_left(products, targets, totals, found)
