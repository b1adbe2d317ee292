"""Sorts the values of a message by their names into the order of the rig."""

from __future__ import annotations

from collections.abc import Sequence

from pam_control.references.trajectory import CommandError


def in_order(
    names: Sequence[str], values: Sequence[float], wanted: Sequence[str], field: str
) -> list[float]:
    """Sort a message's values; names that the rig does not have are ignored.

    Parameters
    ----------
    names, values : sequence
        Names and values of the message.
    wanted : sequence of str
        The rig's names.
    field : str
        Name of the field, for messages.

    Raises
    ------
    CommandError
        For sizes that differ or a name that is missing.
    """
    if len(values) != len(names):
        raise CommandError(f"{len(values)} {field} values for {len(names)} names")
    if list(names) == list(wanted):
        return [float(value) for value in values]
    found = dict(zip(names, values, strict=True))
    missing = [name for name in wanted if name not in found]
    if missing:
        raise CommandError(f"{', '.join(missing)} missing")
    return [float(found[name]) for name in wanted]
