"""One joint is simulated alike by the kernel with all laws and by one without those it has not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.constants import derive_constants
from pam_model.plant.lane_choice import lane_kernels
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import simulate
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
TIME = np.arange(600) * 0.002
SWING = 0.4 * np.sin(9.0 * TIME) + 0.2
COMMANDS = np.stack([SWING, 0.3 - SWING], axis=1)


@pytest.mark.skipif(not HAVE_NUMBA, reason="plain Python has one kernel")
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"coulomb_friction.torque": 0.5},
        {
            "agonist.command_delay.delay": 0.007,
            "agonist.tube_restriction.conductance": 4e-9,
            "antagonist.thermal.conductance": 0.5,
        },
    ],
    ids=["ideal", "friction", "gas"],
)
@pytest.mark.parametrize("prescribed", [False, True])
def test_without_the_laws_that_a_joint_has_not(changes: dict[str, float], prescribed: bool) -> None:
    parameters = PlantParameters.from_rig(load_rig(ELBOW)).forced(changes)
    (kernel,) = lane_kernels(derive_constants(parameters.values)[None])
    given = (
        {"positions": 0.3 * np.sin(5.0 * TIME), "pressures": 2e5 + 5e4 * COMMANDS}
        if prescribed
        else {}
    )
    plain, without = (
        simulate(parameters, COMMANDS, 0.002, kernels=kernels, **given)
        for kernels in ((), (kernel.for_all(1),))
    )
    assert np.ptp(plain.position) > 0.1
    # products and sums are rounded together in other places
    sizes = np.abs(plain.outputs).max(axis=0)
    assert np.all(np.abs(plain.outputs - without.outputs) <= 1e-12 * sizes)
