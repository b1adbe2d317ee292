"""Kinds of fault by name."""

from pam_check.fault_kinds.fault_kind import FaultKind
from pam_check.fault_kinds.kinds import ALL_KINDS


def kind_called(name: str) -> FaultKind:
    """The kind with this name; StopIteration if there is none."""
    return next(kind for kind in ALL_KINDS if kind.name == name)
