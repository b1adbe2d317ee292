"""The Gymnasium environments: gymnasium's own checker, and equality with the plant of the suite."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from pam_model.errors import PamError
from pam_model.plant.parameters import INDEX, PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.simulate import vented_state
from pam_model.rig import Rig, load_rig
from pam_sim.environment import PER_JOINT, EpisodeTask, PamEnv, PamVectorEnv
from pam_sim.randomisation import Randomisation, Spread
from support.rigs import ELBOW

SHORT = EpisodeTask(seconds=0.4, hold=0.2)


def rig_named(name: str) -> Rig:
    return load_rig(ELBOW.with_name(f"{name}.yaml"))


@pytest.mark.filterwarnings("ignore::UserWarning")  # a box without bounds
@pytest.mark.parametrize("name", ["elbow", "two_joints", "elbow_canopen_regulator"])
def test_gymnasiums_checker_passes(name: str) -> None:
    check_env(PamEnv(rig_named(name), SHORT), skip_render_check=True)


@pytest.mark.parametrize("name", ["elbow", "two_joints", "elbow_canopen_regulator"])
def test_observations_are_the_readings_of_the_plant(name: str) -> None:
    rig = rig_named(name)
    joint = replace(rig.joints[0], effects={"coulomb_friction": {"torque": 0.5}})
    rig = rig.with_joint(joint)
    env = PamEnv(rig, SHORT)
    nominal = [PlantParameters.from_rig(rig, one.name) for one in rig.joints]
    plant = RobotPlant(nominal, states=[vented_state(one) for one in nominal])
    seen, _ = env.reset(seed=1)
    generator = np.random.default_rng(2)
    largest = np.array(
        [[rig.muscle(m).max_pressure for m in (one.agonist, one.antagonist)] for one in rig.joints]
    )
    regulated = np.array(
        [
            [rig.muscle(m).valve.kind != "flow" for m in (one.agonist, one.antagonist)]
            for one in rig.joints
        ]
    )
    for _ in range(20):
        action = generator.uniform(-1.0, 1.0, 2 * len(rig.joints))
        pairs = action.reshape(-1, 2)
        commands = np.where(regulated, 0.5 * (pairs + 1.0) * largest, pairs)
        seen, *_ = env.step(action)
        readings = np.array(plant.step(commands.tolist(), SHORT.period))
        of_joint = seen.reshape(-1, PER_JOINT)
        np.testing.assert_allclose(of_joint[:, 0], readings[:, 0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            of_joint[:, 2:4] * largest, readings[:, 1:], rtol=1e-9, atol=1e-6
        )


def test_an_episode_is_truncated_and_all_begin_anew_with_other_numbers() -> None:
    spread = {"payload.mass": Spread(1.0, 0.5, 1.5), "payload.distance": Spread(0.3, 0.3, 0.3)}
    envs = PamVectorEnv(rig_named("elbow"), 5, SHORT, Randomisation(spread))
    first, _ = envs.reset(seed=3)
    nothing = np.zeros((5, 2))
    ends = [envs.step(nothing)[3] for _ in range(20)]
    assert not np.any(ends[:-1]) and np.all(ends[-1])
    again, reward, *_ = envs.step(nothing)
    assert not reward.any()
    assert not np.array_equal(first[:, 4], again[:, 4])
    assert np.array_equal(envs.reset(seed=3)[0], first)


def test_a_diagnosis_gives_the_spreads(tmp_path: Path) -> None:
    found = {
        "coulomb_friction": {"torque": {"value": 1.0, "low": 0.8, "high": 1.4, "unit": "N m"}},
        "leakage": {"conductance.agonist": {"value": 1e-11, "low": 0.0, "high": 2e-11}},
        "hysteresis": {"amplitude": {"value": 0.05, "low": 0.04, "high": 0.06}},
    }
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"parameters": found}))
    randomisation = Randomisation.from_diagnosis(path)
    nominal = PlantParameters.from_rig(load_rig(ELBOW))
    values = randomisation.draw(nominal, 4000, np.random.default_rng(0))
    torque = values[:, INDEX["coulomb_friction.torque"]]
    assert np.percentile(torque, [5, 50, 95]) == pytest.approx([0.8, 1.0, 1.4], abs=0.03)
    assert values[:, INDEX["agonist.leakage.conductance"]].min() == 0.0
    assert not values[:, INDEX["antagonist.leakage.conductance"]].any()
    both = [values[:, INDEX[f"{side}.hysteresis.amplitude"]] for side in ("agonist", "antagonist")]
    assert np.array_equal(*both)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "not a diagnosis"),
        ("[]", "not a diagnosis"),
        ("{}", "no 'parameters'"),
        ("[" * 5000, "nested too deeply"),
        ('{"parameters": {"leakage": {"torque": {"value": 1, "low": 0, "high": 2}}}}', "leakage"),
        ('{"parameters": {"payload": {"mass": {"value": 1, "low": 2, "high": 3}}}}', "no interval"),
        ('{"parameters": {"payload": {"mass": {"value": 1, "low": 0}}}}', "high"),
    ],
)
def test_what_is_no_diagnosis_is_one_line(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    path.write_text(text)
    with pytest.raises(PamError, match=told) as raised:
        Randomisation.from_diagnosis(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "change", [{"period": 0.0}, {"reach": 1.5}, {"effort": -1.0}, {"hold": float("nan")}]
)
def test_a_wrong_task_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(PamError, match=next(iter(change))):
        EpisodeTask(**change)


def test_actions_of_another_shape_are_refused() -> None:
    envs = PamVectorEnv(rig_named("elbow"), 2, SHORT)
    envs.reset(seed=0)
    with pytest.raises(PamError, match=r"expected finite numbers, \(2, 2\)"):
        envs.step(np.zeros((2, 3)))


def test_joints_that_share_a_sagging_supply_are_refused() -> None:
    rig = rig_named("two_joints")
    droop = {"supply_droop": {"conductance": 1e-9, "volume": 1e-3}}
    envs = PamVectorEnv(replace(rig, effects=droop), 2, SHORT)
    with pytest.raises(PamError, match="reservoir"):
        envs.reset(seed=0)
