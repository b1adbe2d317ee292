"""Force models without a formula in the plant enter it as tables that reproduce them."""

from __future__ import annotations

import numpy as np
import pytest

from pam_model.muscles.force_model import registered_models
from pam_model.plant.force_table import closed_form
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate

POSITIONS = np.linspace(-0.5, 0.5, 101)
PRESSURES = np.stack([np.linspace(2e4, 5e5, 101), np.linspace(4e5, 1e5, 101)], axis=1)


def usable(name):
    """Whether all constants of the model have a default."""
    return all(
        entry.default is not None for entry in registered_models()[name].model.parameters.values()
    )


@pytest.mark.parametrize("name", sorted(filter(usable, registered_models())))
def test_plant_pulls_and_holds_what_the_model_says(make_rig, name):
    rig = make_rig(muscle={"model": name, "wall_thickness": 0.0012})
    try:
        model = rig.force_model("elbow_flexor")
        model.force(2e5, np.linspace(0.205, 0.245, 5))
    except ValueError as error:
        pytest.skip(f"no muscle of this size: {error}")
    parameters = PlantParameters.from_rig(rig)
    result = simulate(
        parameters, np.zeros((101, 2)), 2e-3, initial_state(parameters),
        positions=POSITIONS, pressures=PRESSURES,
    )  # fmt: skip
    for i, sign in enumerate((-1, 1)):
        lengths = 0.225 + sign * 0.03 * POSITIONS
        force = np.maximum(model.force(PRESSURES[:, i], lengths), 0.0)
        np.testing.assert_allclose(
            result.forces[:, i], force, rtol=2e-4, atol=2e-4 * np.max(force) + 1e-9
        )
    # Shut chambers: P (V + dead) is constant, with the volume of the model.
    state = initial_state(parameters, position=POSITIONS[0], pressures=(2e5, 2e5))
    shut = simulate(parameters, np.zeros((101, 2)), 2e-3, state, positions=POSITIONS, shut=True)
    volume = model.volume(shut.lengths[:, 0]) + rig.muscles[0].dead_volume
    gas = (shut.pressures[:, 0] + rig.gas.ambient_pressure) * volume
    np.testing.assert_allclose(gas, gas[0], rtol=2e-5)


def test_a_wall_of_constant_thickness_conserves_energy(make_rig, run):
    rig = make_rig(muscle={"wall_thickness": 0.0015}, joint={"viscous_friction": 0.0})
    parameters = PlantParameters.from_rig(rig)
    assert closed_form("chou_hannaford", rig.muscles[0].geometry, {}) == (0.0015, 1.0)
    result = run(parameters, commands=np.zeros((400, 2)), position=0.4, shut=True)
    model, ambient = rig.force_model("elbow_flexor"), rig.gas.ambient_pressure
    volume = model.volume(result.lengths) + rig.muscles[0].dead_volume
    amount = (result.pressures + ambient) * volume
    joint = rig.joints[0]
    energy = (
        0.5 * joint.inertia * result.velocity**2
        - joint.gravity_torque * np.cos(result.position)
        + np.sum(-amount[0] * np.log(volume) + ambient * volume, axis=1)
    )
    np.testing.assert_allclose(energy, energy[0], atol=1e-7)


def test_tondu_lopez_factor_and_end_caps_multiply(make_rig, run):
    factor = make_rig(muscle={"model": "tondu_lopez", "model_parameters": {"k": 1.1}})
    caps = PlantParameters.from_rig(make_rig()).replaced({"end_caps.factor": 1.1})
    np.testing.assert_allclose(
        run(PlantParameters.from_rig(factor)).position, run(caps).position, atol=1e-9
    )
