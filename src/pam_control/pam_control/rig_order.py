"""A message's values in the order of the rig, by their names."""

from __future__ import annotations

from collections.abc import Sequence

from pam_control.references.trajectory import CommandError


def in_order(
    names: Sequence[str], values: Sequence[float], wanted: Sequence[str], field: str
) -> list[float]:
    """Sort a message's values; more names than the rig's are fine.

    Parameters
    ----------
    names, values : sequence
        Of the message.
    wanted : sequence of str
        The rig's names.
    field : str
        What the values are, for messages.

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
