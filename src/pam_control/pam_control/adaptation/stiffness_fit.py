"""The filters and the fit of `stiffness_estimate`, as functions of rows of numbers.

numba compiles these functions with whatever calls them; without numba, the rows are lists.
"""

from __future__ import annotations

from typing import Any, Final

from pam_control.adaptation.fading_sums import add_fading, rms_left
from pam_control.adaptation.motion_functions import element, move_memory
from pam_control.adaptation.normal_equations import CORRELATED, factorise, substitute
from pam_model.plant.compiled import entry_point

FILTER: Final = 0.03  # s, of both filters
SLOWEST: Final = 0.04  # rad/s; friction may be anything in a joint that stands still
DIFFERENCE: Final = 1e-3  # relative step of the derivatives

# Rows of the filters: as measured, once and twice filtered
MEASURED, ONCE, TWICE, N_FILTERS = range(4)
# Rows of changes: as found, and where the derivatives were taken
FOUND, ABOUT, N_WEIGHTS = range(3)


def _trapezoid(filtered: float, before: float, now: float, step: float) -> float:
    """The filter 1/(T s + 1) after a step [s] between two values of its input."""
    return ((2.0 * FILTER - step) * filtered + step * (before + now)) / (2.0 * FILTER + step)


def torque_of_model(model: int, pulls: Any, places: Any, levers: Any) -> float:
    """Torque of the muscles by one of the models [N m]; see `take_torques`."""
    total, muscles = 0.0, len(places[model])
    for k in range(muscles):
        total += levers[model][k] * pulls[places[model][k]]
    return float(levers[model][muscles] * total)


def write_inputs(
    known: float, gravity: float, position: float, pulls: Any, places: Any, levers: Any, about: Any,
    slip: Any, inputs: Any,
) -> None:  # fmt: skip
    """Write the torque that the model does not explain, its derivatives, and what else is fitted.

    `slip` is the memory of the slip element at this position [rad]; otherwise see `take_torques`.
    """
    torque, count = torque_of_model(0, pulls, places, levers), len(places) - 1
    whole = torque + known
    for i in range(count):
        slope = (torque_of_model(1 + i, pulls, places, levers) - torque) / DIFFERENCE
        inputs[1 + i] = slope
        # as if the model were that of the rig file, so that the changes are counted from it
        whole -= slope * about[i]
    inputs[0], inputs[count + 1] = whole, element(slip, 0, 0)
    inputs[count + 2], inputs[count + 3] = gravity, position


@entry_point
def take_torques(
    known: float, gravity: float, position: float, elapsed: float, inertia: float, damping: float,
    begins: bool, counts: bool, pulls: Any, places: Any, levers: Any, weights: Any, slip: Any,
    inputs: Any, filters: Any, parts: Any, products: Any, targets: Any, totals: Any,
    load_products: Any, load_targets: Any, load_totals: Any,
) -> bool:  # fmt: skip
    """Filter a sample, and add it to the sums if the joint moves; return whether it was added.

    Parameters
    ----------
    known : float
        Torque beside that of the muscles' force, inertia, damping and gravity [N m].
    gravity, position : float
        Torque of the weight [N m] at the position [rad].
    elapsed : float
        Time since the last sample [s].
    inertia, damping : float
        Of the joint by the rig file [kg m^2], [N m s/rad].
    begins, counts : bool
        Whether the filters begin with this sample; whether they have settled.
    pulls : row
        Those that differ between the models [N].
    places, levers : rows
        Of the model and of those with one number changed: which pull is that of each muscle; ratio
        of each muscle's arm, and then the radius that they refer to [m].
    weights : rows
        `ABOUT`: the changes of the numbers of the model [-].
    slip : row
        Memory of the slip element, changed.
    inputs : row
        (n,) scratch: torque that the model does not explain, its derivatives by the numbers [N m],
        slip element [-], gravity [N m] and position [rad].
    filters : rows
        (`N_FILTERS`, n), changed.
    parts : row
        (n - 1,) scratch: derivatives, inertia, damping, gravity, slip element.
    products, targets, totals
        Sums of all parts but the last (`fading_sums`), changed.
    load_products, load_targets, load_totals
        Sums of all parts, changed.
    """
    move_memory(slip, 0, position, elapsed)
    write_inputs(known, gravity, position, pulls, places, levers, weights[ABOUT], slip, inputs)
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
