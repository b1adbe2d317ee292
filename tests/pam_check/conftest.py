"""The chain in motion in which faults are brought about: every test acts in a fork of it."""

from __future__ import annotations

import pytest

from pam_check.faults.campaign import make_chain
from pam_check.faults.chain import FaultChain
from pam_model.rig import Rig


@pytest.fixture(scope="session", autouse=True)
def designs_are_shared(shared_designs: None) -> None:
    """Before any chain is made."""


@pytest.fixture(scope="session")
def chain(rig: Rig) -> FaultChain:
    """Driver, controller, model and simulated elbow on a virtual clock, moving."""
    return make_chain(rig)
