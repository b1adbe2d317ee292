"""Sorts the values of a message by their names into the order of the rig."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_control.references.trajectory import CommandError


def in_order(
    names: Sequence[str], values: Sequence[float], wanted: Sequence[str], field: str
) -> list[float] | None:
    """Sort a message's values; names that the rig does not have are ignored.

    A name of the rig that a message leaves out is not measured: `joint_states` has no NaN.

    Parameters
    ----------
    wanted : sequence of str
        The rig's names.
    field : str
        Name of the field, for messages.

    Returns
    -------
    list of float or None
        In the order of the rig, NaN for a name that is missing; None for a message about other
        joints, such as those of a gripper.

    Raises
    ------
    CommandError
        For sizes that differ, or a name that is given twice.
    """
    if len(values) != len(names):
        raise CommandError(f"{len(values)} {field} values for {len(names)} names")
    if tuple(names) == tuple(wanted):
        return list(map(float, values))
    found = dict(zip(names, values, strict=True))
    if len(found) != len(names):
        raise CommandError(f"{field}: a name is given twice")
    if found and not any(name in found for name in wanted):
        return None
    return [float(found.get(name, math.nan)) for name in wanted]
