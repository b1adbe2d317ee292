"""Kinds of fault by name."""

from pam_sim.faults.fault_kind import FaultKind
from pam_sim.faults.kinds import ALL_KINDS


def kind_called(name: str) -> FaultKind:
    """The kind with this name; StopIteration if there is none."""
    return next(kind for kind in ALL_KINDS if kind.name == name)
