"""Rigs and runs that several tests share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_model.rig import Rig, load_rig
from pam_sim.plant import initial_state, simulate
from pam_sim.plant_parameters import PlantParameters

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"


@pytest.fixture(scope="session")
def rig() -> Rig:
    return load_rig(ELBOW)


@pytest.fixture(scope="session")
def parameters(rig) -> PlantParameters:
    return PlantParameters.from_rig(rig)


@pytest.fixture(scope="session")
def make_rig(rig):
    """The elbow with fields of its gas, joint, both muscles or both valves changed."""

    def make(*, gas=None, joint=None, muscle=None, valve=None, **top) -> Rig:
        result = replace(rig, gas=replace(rig.gas, **(gas or {})), **top)
        result = result.with_joint(replace(result.joints[0], **(joint or {})))
        for entry in result.muscles:
            new_valve = replace(entry.valve, **(valve or {}))
            result = result.with_muscle(replace(entry, valve=new_valve, **(muscle or {})))
        return result

    return make


@pytest.fixture(scope="session")
def wiggle():
    """Smooth valve commands (n, 2) that swing the joint, and their sample time."""
    time = np.arange(600) * 2e-3
    swing = 0.25 * np.sin(2 * np.pi * 1.1 * time) + 0.1 * np.sin(2 * np.pi * 2.7 * time)
    return np.stack([swing, -swing + 0.02], axis=1), 2e-3


@pytest.fixture(scope="session")
def run(wiggle):
    """Simulate the swing from 2 bar in both muscles."""

    def go(parameters, *, commands=None, pressures=(2e5, 2e5), position=0.0, velocity=0.0, **kw):
        state = initial_state(parameters, pressures=pressures, position=position, velocity=velocity)
        u = wiggle[0] if commands is None else commands
        return simulate(parameters, u, wiggle[1], state, **kw)

    return go
