"""MuJoCo reads both exports, and moves as the plant of the suite does, with the rig's effects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pam_model.__main__ import main
from pam_model.command_line import DONE
from pam_model.effects import EFFECTS
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose
from pam_model.views.mjcf import AffinePull, robot_as_mjcf
from pam_model.views.torque_balance import dry_friction_at_rest
from pam_model.views.urdf import robot_as_urdf
from support.rigs import ELBOW

OWNER = {"joint": "joints", "muscle": "muscles"}
NOT_STATED = {"stribeck_friction", "hysteresis", "creep"}
NAMED = sorted(
    name for name, effect in EFFECTS.items()
    if effect.stage in OWNER and name not in NOT_STATED
)  # fmt: skip
OF_JOINT = ["none", *(name for name in NAMED if EFFECTS[name].stage == "joint")]
FREE = {"bladder_elasticity": 0.02}  # rad; the bladder's cubic term is no line
DRIVEN = {"cable_compliance": 0.08}  # of the motion; a cable makes the pull curve with the pressure
PULL = {"cable_compliance": 0.04}
SAMPLE = 0.002  # s


@pytest.fixture(scope="module")
def mujoco() -> Any:
    return pytest.importorskip("mujoco", reason="pip install 'pam_model[mujoco]' for this test")


def with_effect(name: str) -> Rig:
    """The elbow with an effect of the size that its page shows, on the joint or on both muscles."""
    rig = load_rig(ELBOW)
    if name == "none":
        return rig
    effect = EFFECTS[name]
    owner = OWNER[effect.scope]
    effects = {name: dict(effect.portrait.sizes)}
    return replace(
        rig, **{owner: tuple(replace(one, effects=effects) for one in getattr(rig, owner))}
    )


def sweep(seconds: float) -> np.ndarray:
    """Pressures that turn the joint to and fro, ever faster [Pa]."""
    time = np.arange(round(seconds / SAMPLE)) * SAMPLE
    swing = 7e4 * np.sin(2.0 * time + time**2)
    return np.stack([2e5 + swing, 2e5 - swing], axis=1)


def own_motion(rig: Rig, pressures: np.ndarray, start: float) -> np.ndarray:
    plant = PlantParameters.from_rig(rig)
    state = initial_state(plant, position=start, pressures=pressures[0])
    shut = np.zeros_like(pressures)
    return simulate(plant, shut, SAMPLE, state, pressures=pressures).position


def mujoco_motion(mujoco: Any, document: str, pressures: np.ndarray, start: float) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(document)
    data = mujoco.MjData(model)
    data.qpos[0] = start
    steps = round(SAMPLE / model.opt.timestep)
    found = []
    for now, then in zip(pressures, [*pressures[1:], pressures[-1]], strict=True):
        found.append(float(data.qpos[0]))
        for step in range(steps):
            if model.nu:
                data.ctrl[:] = now + (then - now) * (step + 0.5) / steps
            mujoco.mj_step(model, data)
    return np.array(found)


@pytest.mark.parametrize("name", ["none", *NAMED])
def test_free_motion_is_that_of_the_plant(name: str, mujoco: Any) -> None:
    rig, vented = with_effect(name), np.zeros((1000, 2))
    found = mujoco_motion(mujoco, robot_as_mjcf(compose(rig), "arm"), vented, 0.8)
    assert np.abs(found - own_motion(rig, vented, 0.8)).max() < FREE.get(name, 2e-3)


@pytest.mark.parametrize("name", ["none", *NAMED])
def test_motion_under_given_pressures_is_that_of_the_plant(name: str, mujoco: Any) -> None:
    rig, pressures = with_effect(name), sweep(3.0)
    found = mujoco_motion(mujoco, robot_as_mjcf(compose(rig), "arm"), pressures, 0.0)
    own = own_motion(rig, pressures, 0.0)
    assert np.std(own) > 0.1
    assert np.sqrt(np.mean((found - own) ** 2)) < DRIVEN.get(name, 0.03) * np.std(own)


@pytest.mark.parametrize("name", OF_JOINT)
def test_urdf_swings_freely_as_the_plant_does(name: str, mujoco: Any) -> None:
    """MuJoCo is the parser; its damping and friction are those of <dynamics>."""
    rig, vented = with_effect(name), np.zeros((1000, 2))
    robot = compose(rig)
    document = robot_as_urdf(robot, "arm").replace(
        '<link name="base_link" />',
        '<mujoco><compiler discardvisual="true"/><option timestep="0.0005"/></mujoco>'
        '<link name="base_link" />',
    )
    joint = robot.joints[0]
    model = mujoco.MjModel.from_xml_string(document)
    assert model.dof_damping[0] == pytest.approx(joint.viscous_friction)
    assert model.dof_frictionloss[0] == pytest.approx(dry_friction_at_rest(joint))
    assert model.jnt_range[0] == pytest.approx(joint.position_limits)
    found = mujoco_motion(mujoco, document, vented, 0.8)
    # Friction is softer than in our MJCF: URDF has no place for how stiff it is.
    bound = 2e-3 if dry_friction_at_rest(joint) == 0.0 else 2e-2
    assert np.abs(found - own_motion(rig, vented, 0.8)).max() < bound


def test_two_joints_are_two_bodies_with_four_muscles(mujoco: Any) -> None:
    robot = compose(load_rig(ELBOW.with_name("two_joints.yaml")))
    model = mujoco.MjModel.from_xml_string(robot_as_mjcf(robot, "arm"))
    assert (model.nv, model.nu, model.ntendon) == (2, 4, 4)
    assert [model.actuator(place).name for place in range(4)] == list(robot.muscle_names)


# --- without MuJoCo -------------------------------------------------------------------------------


def test_the_pull_of_every_muscle_is_affine_within_what_the_page_says() -> None:
    page = (ELBOW.parents[1] / "docs/other_simulators.md").read_text()
    assert "within 3 %" in page
    for name in ("none", *NAMED):
        robot = compose(with_effect(name))
        for muscle in robot.muscles:
            assert AffinePull.of(robot, muscle).error < PULL.get(name, 0.03), name


@pytest.mark.parametrize("name", ["none", *NAMED, *sorted(NOT_STATED)])
def test_what_mjcf_cannot_state_is_told(name: str) -> None:
    document = robot_as_mjcf(compose(with_effect(name)), "arm")
    assert ("not in MJCF:" in document) == (name in NOT_STATED)


def test_the_command_writes_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "new/elbow.xml"
    assert main(["mjcf", "--rig", str(ELBOW), "--output", str(there)]) == DONE
    assert there.read_text() == robot_as_mjcf(compose(load_rig(ELBOW)), "elbow")
    assert "written" in capsys.readouterr().out
