"""Compares the steps of the boot with the EDS file: what the device would refuse is named.

The boot walks the same list of steps. A device whose file says that an object is missing, or cannot
be written, answers with an abort code; here the answer is the key of the rig file that avoids it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from pam_driver.boards.canopen.device import Check, Step
from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName
from pam_driver.boards.canopen.pdo_plan import TPDO, PdoDirection, PdoPlan

HEARTBEAT: Final = ObjectName(0x1017)
_PDOS: Final = range(0x1400, 0x1C00)
_IDENTITY: Final = 0x1018
_LAST_SYNC: Final = 240  # of the transmission types of CiA 301


class Refusal(NamedTuple):
    """What a device would refuse: the key of the rig file that changes it, and the message."""

    key: str
    text: str


def refused_steps(steps: Iterable[Step], dictionary: Dictionary, file_key: str) -> list[Refusal]:
    """The steps that the device refuses by its EDS file.

    Parameters
    ----------
    steps : iterable of Write or Check
        The steps of the boot.
    dictionary : Dictionary
        What the EDS file says.
    file_key : str
        The key of the rig file that names the EDS file, for steps that no other key changes.

    Returns
    -------
    list of Refusal
        The first refusal of each key and each reason.
    """
    found: dict[tuple[str, str], Refusal] = {}
    for step in steps:
        reason = _reason(step, dictionary)
        if not reason or (not isinstance(step, Check) and step.may_fail):
            continue
        key, remedy = _remedy(step, file_key)
        line = dictionary.line(step.name)
        place = f"{dictionary.file}, line {line}" if line else dictionary.file
        text = f": {place}: {step.name} ({step.why}) {reason}{remedy}"
        found.setdefault((key, remedy or str(step.name)), Refusal(key, text))
    return list(found.values())


def _reason(step: Step, dictionary: Dictionary) -> str:
    """Why a device would refuse a step; empty if it would not."""
    entry = dictionary.find(step.name)
    if entry is None:
        return "is not there"
    if not isinstance(step, Check):
        return "" if entry.writable else f"cannot be written ({entry.access_type})"
    if not entry.readable:
        return f"cannot be read ({entry.access_type})"
    stated = dictionary.default(step.name)
    if entry.access_type == "const" and stated is not None and (stated ^ step.expected) & step.mask:
        return f"is always 0x{stated & step.mask:X}, expected 0x{step.expected & step.mask:X}"
    return ""


def _remedy(step: Step, file_key: str) -> tuple[str, str]:
    """The key of the rig file that leaves a step out, and what to write there."""
    if step.name.index in _PDOS and not isinstance(step, Check):
        return "pdo_mapping", "; pdo_mapping: read takes the PDOs as they are"
    if step.name == HEARTBEAT:
        return file_key, "; the driver guards a device by its heartbeat, and this one has none"
    if step.name.index == _IDENTITY:
        return "identity", "; leave this number out"
    return file_key, ""


def refused_timing(
    plan: PdoPlan, direction: PdoDirection, dictionary: Dictionary, *, sync: bool, period: int
) -> Iterator[Refusal]:
    """What a PDO cannot do because its transmission type or event timer is fixed.

    Parameters
    ----------
    direction : PdoDirection
        Whether the device receives or transmits it.
    dictionary : Dictionary
        What the EDS file says.
    sync : bool
        Whether the driver sends SYNC.
    period : int
        Wanted event timer of a TPDO without SYNC [ms].
    """
    index, called = direction.parameters + plan.number - 1, f"{direction.word}{plan.number}"
    kind = _fixed(ObjectName(index, 2), dictionary)
    follows_sync = kind is not None and kind <= _LAST_SYNC
    if follows_sync and not sync:
        yield Refusal(
            "transmission",
            f" = event: {called} of {dictionary.file} has the fixed transmission type {kind}, "
            "which waits for SYNC; transmission: sync is needed",
        )
    if direction is not TPDO:
        return
    if sync:
        if kind is not None and not follows_sync:
            yield Refusal(
                "transmission",
                f" = sync: {called} of {dictionary.file} has the fixed transmission type {kind}, "
                "which ignores SYNC; transmission: event is needed",
            )
        return
    if follows_sync:
        return
    timer = ObjectName(index, 5)
    fixed = _fixed(timer, dictionary)
    if timer not in dictionary or fixed == 0:
        yield Refusal(
            "transmission",
            f" = event: a TPDO of {dictionary.file} has no event timer (sub-index 5); "
            "transmission: sync is needed",
        )
    elif fixed is not None and fixed != period:
        yield Refusal(
            "period",
            f" = {period / 1000:g} s: {called} of {dictionary.file} has an event timer fixed at "
            f"{fixed} ms; write {fixed / 1000:g}",
        )


def _fixed(name: ObjectName, dictionary: Dictionary) -> int | None:
    """The value of an object that cannot be written; None if it can, or has no stated value."""
    entry = dictionary.find(name)
    return None if entry is None or entry.writable else dictionary.default(name)
