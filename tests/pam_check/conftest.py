"""The chain in motion in which faults are brought about: every test acts in a fork of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from pam_check.faults.campaign import make_chain
from pam_check.faults.chain import FaultChain
from pam_control.feedback.kept_designs import KeptDesigns
from pam_model.rig import Rig


@pytest.fixture(scope="session", autouse=True)
def designs_are_shared(shared_designs: KeptDesigns) -> Iterator[None]:
    """Before any chain is made; the comparisons do not keep their designs in the user's folder."""
    from pam_check.control import rough_control

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rough_control, "KeptDesigns", lambda _: shared_designs)
        yield


@pytest.fixture(scope="session")
def chain(rig: Rig) -> FaultChain:
    """Driver, controller, model and simulated elbow on a virtual clock, moving."""
    return make_chain(rig)
