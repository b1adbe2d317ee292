"""Numbers that a program passes are checked as those of a file are: type, finite, bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pam_model.errors import PamError
from pam_ros.foreign_text import shown


def within(
    what: str,
    value: object,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "-",
    *,
    above: float | None = None,
    error: type[PamError] = PamError,
) -> float:
    """A finite number within bounds.

    Parameters
    ----------
    what : str
        Its name in the message.
    value : object
        What was handed over.
    low, high : float
        Closed bounds, in `unit`.
    unit : str
        "-" for none.
    above : float, optional
        An open lower bound.
    error : type
        What is raised.

    Raises
    ------
    PamError
        Or `error`, for anything else than such a number.
    """
    try:
        number = float(value)  # type: ignore[arg-type]  # whatever it is
        is_number = not isinstance(value, str | bytes | bool)
    except (TypeError, ValueError, OverflowError):
        number, is_number = math.nan, False
    is_above = above is None or number > above
    if is_number and math.isfinite(number) and low <= number <= high and is_above:
        return number
    suffix = "" if unit == "-" else f" {unit}"
    wanted = "a finite number" if unit == "-" else "a finite number in"
    if above is not None:
        wanted = f"a number above {above:g}"
        wanted += f" and at most {high:g}" if high < math.inf else ""
    elif low > -math.inf:
        wanted = f"from {low:g} to {high:g}" if high < math.inf else f"a number from {low:g} on"
    told = f"{number:g}" if is_number else shown(str(value))
    raise error(f"{what} = {told}{suffix if is_number else ''}: must be {wanted}{suffix}")


def check_numbers(
    owner: object,
    where: str,
    bounds: Mapping[str, tuple[float, float, str]],
    *,
    error: type[PamError] = PamError,
) -> None:
    """Check attributes of an object; one that is None is left out.

    Parameters
    ----------
    owner : object
        Has the attributes.
    where : str
        Stands before their names in the message.
    bounds : mapping
        Attribute -> lowest and highest value and unit.
    error : type
        What is raised.

    Raises
    ------
    PamError
        Or `error`, for an attribute that is no finite number within its bounds.
    """
    for name, (low, high, unit) in bounds.items():
        value = getattr(owner, name)
        if value is not None:
            within(f"{where}.{name}" if where else name, value, low, high, unit, error=error)
