"""Rigs and runs that several tests share."""

from __future__ import annotations

import numpy as np
import pytest

from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate


@pytest.fixture(scope="session")
def parameters(rig) -> PlantParameters:
    return PlantParameters.from_rig(rig)


@pytest.fixture(scope="session")
def wiggle():
    """Smooth valve commands (n, 2) that move the joint to and fro, and their sample time."""
    time = np.arange(600) * 2e-3
    swing = 0.25 * np.sin(2 * np.pi * 1.1 * time) + 0.1 * np.sin(2 * np.pi * 2.7 * time)
    return np.stack([swing, -swing + 0.02], axis=1), 2e-3


@pytest.fixture(scope="session")
def run(wiggle):
    """Simulate this motion from 2 bar in both muscles."""

    def go(parameters, *, commands=None, pressures=(2e5, 2e5), position=0.0, velocity=0.0, **kw):
        state = initial_state(parameters, pressures=pressures, position=position, velocity=velocity)
        u = wiggle[0] if commands is None else commands
        return simulate(parameters, u, wiggle[1], state, **kw)

    return go
