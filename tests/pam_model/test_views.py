"""The views of a robot against other calculations, with the effects that a rig file names."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pam_model.effects.payload import GRAVITY
from pam_model.gas import GAS_CONSTANT, reference_density, reference_flow
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import Rig, load_rig
from pam_model.robot import Arm, Robot, compose
from pam_model.views.exhaust_torque import exhaust_pressure_rate, exhaust_torque_rate
from pam_model.views.gravity import gravity_stiffness, gravity_torque, hanging_position
from pam_model.views.muscle_path import lengths_over_travel, path_length, path_speed
from pam_model.views.pressure_rate import entering_flow, valve_mass_flow
from pam_model.views.shut_spring import driven_speed, shut_joint_stiffness
from pam_model.views.time_to_empty import emptying_time_constant, time_to_empty
from pam_model.views.time_to_fill import LONGEST, delay_of_supply, time_to_fill
from pam_model.views.torque_range import first_angle_not_held, torque_range
from pam_model.views.urdf import robot_as_urdf

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"
TUBE = {"tube_restriction": {"conductance": 1.5e-9, "volume": 2e-5}}
NARROW = {"exhaust_restriction": {"ratio": 0.4}}


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(ELBOW)


def with_muscles(rig: Rig, **effects: dict[str, float]) -> Robot:
    return compose(
        replace(rig, muscles=tuple(replace(one, effects=effects) for one in rig.muscles))
    )


def with_joint(rig: Rig, **effects: dict[str, float]) -> Robot:
    return compose(rig.with_joint(replace(rig.joints[0], effects=effects)))


# --- topology -------------------------------------------------------------------------------------


def test_a_muscle_may_turn_any_number_of_joints(rig: Rig) -> None:
    """No rig file has a muscle over two joints yet, but nothing in a robot is against it."""
    robot = compose(rig)
    arms = (Arm(0, 0, 0.03), Arm(1, 0, -0.02))
    joints = tuple(
        replace(robot.joints[0], place=place, arms=(arms[place],), position_limits=limits)
        for place, limits in enumerate(((-1.0, 1.0), (-0.5, 0.2)))
    )
    muscle = replace(robot.muscles[0], arms=arms)
    over_two = replace(robot, joints=joints, muscles=(muscle,))
    assert path_length(muscle, (0.4, -0.3)) == pytest.approx(0.225 - 0.03 * 0.4 - 0.02 * 0.3)
    assert path_speed(muscle, (2.0, 1.0)) == pytest.approx(-0.06 + 0.02)
    lengths = lengths_over_travel(over_two, muscle, 3)
    assert len(lengths) == 9
    assert min(lengths) == pytest.approx(0.225 - 0.03 - 0.02 * 0.5)
    assert max(lengths) == pytest.approx(0.225 + 0.03 + 0.02 * 0.2)


def test_gravity_is_a_torque_and_its_slope(rig: Rig) -> None:
    joint = with_joint(rig, payload={"mass": 2.0, "distance": 0.4}).joints[0]
    most, step = 4.9 + 2.0 * GRAVITY * 0.4, 1e-6
    for position in (-0.7, 0.0, 0.9):
        assert gravity_torque(joint, position) == pytest.approx(-most * math.sin(position))
        slope = gravity_torque(joint, position + step) - gravity_torque(joint, position - step)
        assert gravity_stiffness(joint, position) == pytest.approx(-slope / (2.0 * step))
    turned = replace(joint, gravity_torque=-1.0)
    assert gravity_torque(turned, hanging_position(turned)) == pytest.approx(0.0, abs=1e-12)
    assert gravity_stiffness(turned, hanging_position(turned)) > 0.0


# --- air ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("opening", [1.0, 0.3, -1.0, -0.2])
@pytest.mark.parametrize("pressure", [1.2e5, 3e5, 6e5])
def test_the_flow_through_a_tube_is_that_of_both_restrictions(
    rig: Rig, opening: float, pressure: float
) -> None:
    robot = with_muscles(rig, **TUBE)
    muscle, density = robot.muscles[0], reference_density(rig.gas.temperature)
    through = entering_flow(robot, muscle, opening, pressure)
    assert 0.0 < through / valve_mass_flow(robot, muscle, opening, pressure) < 1.0
    ends = sorted((pressure, rig.supply_pressure if opening > 0.0 else 101325.0))
    grid = np.linspace(*ends, 200_001)
    tube = density * np.array(
        [reference_flow(1.5e-9, muscle.valve.critical_ratio, p, pressure) for p in grid[::100]]
    )
    valve = np.array([valve_mass_flow(robot, muscle, opening, p) for p in grid[::100]])
    between = int(np.argmin(np.abs(tube - valve)))
    assert through == pytest.approx(tube[between], rel=0.02, abs=1e-7)


@pytest.mark.parametrize("effects", [{}, NARROW, TUBE, NARROW | TUBE], ids=str)
def test_the_time_to_empty_is_that_of_the_plant(rig: Rig, effects: dict[str, dict]) -> None:
    """The plant knows the tube as a chamber of its own, and opens its valve with a lag."""
    still = {"joint.inertia": 1e7}
    muscles = tuple(replace(one, effects=effects) for one in rig.muscles)
    whole = replace(rig, muscles=muscles).with_joint(
        replace(rig.joints[0], position_limits=(-1e-3, 1e-3))
    )
    parameters = PlantParameters.from_rig(whole).forced(still)
    start = initial_state(parameters, pressures=(5e5, 5e5), commands=(-1.0, -1.0))
    moved = simulate(parameters, np.full((8000, 2), -1.0), 1e-3, start)
    emptied = moved.time[np.argmax(moved.pressures[:, 0] < 2e4)]
    robot = compose(whole)
    ratio = time_to_empty(robot, robot.muscles[0], 5e5, 2e4) / emptied
    # the gas of the tube counts at the pressure of the muscle, which is higher
    assert 0.97 < ratio < (1.15 if "tube_restriction" in effects else 1.03)


def test_a_narrow_exhaust_and_a_tube_empty_a_muscle_more_slowly(rig: Rig) -> None:
    plain = compose(rig)
    usual = emptying_time_constant(plain, plain.muscles[0], 8e3)
    narrow = with_muscles(rig, **NARROW)
    assert emptying_time_constant(narrow, narrow.muscles[0], 8e3) == pytest.approx(usual / 0.4)
    tube = with_muscles(rig, **TUBE)
    assert emptying_time_constant(tube, tube.muscles[0], 8e3) > 2.0 * usual
    assert exhaust_pressure_rate(narrow, narrow.muscles[0], 2e5, [0.1]) == pytest.approx(
        0.4 * exhaust_pressure_rate(plain, plain.muscles[0], 2e5, [0.1])
    )


def test_torque_leaves_with_the_pressure(rig: Rig) -> None:
    robot = compose(rig)
    arm = robot.joints[0].arms[1]
    muscle = robot.muscles[1]
    area = float(muscle.force_model.force(1e5, path_length(muscle, [0.2]))) / 1e5
    expected = 0.03 * area * exhaust_pressure_rate(robot, muscle, 2e5, [0.2])
    assert exhaust_torque_rate(robot, arm, 2e5, [0.2]) == pytest.approx(expected, rel=1e-6)
    assert exhaust_torque_rate(robot, arm, -1e3, [0.2]) == 0.0, "it is empty"


def test_a_supply_that_sags_fills_later(rig: Rig) -> None:
    ideal = compose(rig)
    assert delay_of_supply(ideal, ideal.muscles[0], 5e4) == 0.0
    droop = {"supply_droop": {"conductance": 1e-10, "volume": 2e-5}}
    robot = compose(replace(rig, effects=droop))
    muscle, gas, valve = robot.muscles[0], rig.gas, rig.muscles[0].valve
    volume = float(muscle.force_model.volume(muscle.neutral_length)) + muscle.dead_volume
    heat, density = GAS_CONSTANT * gas.temperature, reference_density(gas.temperature)

    def rates(_: float, state: np.ndarray) -> list[float]:
        inside, before = state.tolist()
        critical = valve.critical_ratio
        drawn = density * reference_flow(valve.sonic_conductance, critical, before, inside)
        refill = density * reference_flow(1e-10, critical, rig.supply_pressure, before)
        return [heat * drawn / volume, heat * (refill - drawn) / 2e-5]

    time = time_to_fill(robot, muscle, 0.0, 3e5)
    solved = solve_ivp(
        rates, (0.0, time), [gas.ambient_pressure, rig.supply_pressure], method="Radau", rtol=1e-8
    )
    assert solved.y[0, -1] == pytest.approx(3e5 + gas.ambient_pressure, rel=1e-4)
    wait = time - time_to_fill(ideal, ideal.muscles[0], 0.0, 3e5)
    assert delay_of_supply(robot, muscle, 3e5) == pytest.approx(wait)
    assert wait > 0.3
    dry = compose(replace(rig, effects={"supply_droop": {"conductance": 1e-16, "volume": 1e-6}}))
    assert math.isinf(time_to_fill(dry, dry.muscles[0], 0.0, 5e5))
    assert delay_of_supply(dry, dry.muscles[0], 5e5) == LONGEST


def test_the_air_drives_a_joint_as_its_spring_does(rig: Rig) -> None:
    robot = with_joint(rig, payload={"mass": 1.0, "distance": 0.3})
    joint = robot.joints[0]
    stiffness = shut_joint_stiffness(robot, joint, [3e5, 2e5], [0.1])
    speed = driven_speed(robot, joint, -40.0, [3e5, 2e5], [0.1])
    assert speed == pytest.approx(40.0 * math.sqrt((0.05 + 0.09) / stiffness))
    assert driven_speed(robot, joint, 40.0, [math.nan, 2e5], [0.1]) == 0.0


# --- torque and export ----------------------------------------------------------------------------


def test_the_torque_that_holds_a_load(rig: Rig) -> None:
    assert first_angle_not_held(compose(rig), compose(rig).joints[0]) is None
    robot = with_joint(rig, payload={"mass": 20.0, "distance": 0.35})
    found = first_angle_not_held(robot, robot.joints[0])
    assert found is not None
    assert found.position == -1.0
    assert found.gravity == pytest.approx((4.9 + 7.0 * GRAVITY) * math.sin(1.0))
    least, most = torque_range(robot, robot.joints[0], -1.0)
    assert found.muscles == pytest.approx(-least)
    assert least < 0.0 < most


def test_urdf_states_friction_and_payload(rig: Rig) -> None:
    """They were left out without a word."""
    robot = with_joint(
        rig,
        coulomb_friction={"torque": 0.4},
        viscous_friction={"extra": 0.3},
        payload={"mass": 0.8, "distance": 0.25},
    )
    document = ET.fromstring(robot_as_urdf(robot, "arm"))
    dynamics = document.find("joint/dynamics")
    assert dynamics is not None
    assert float(dynamics.attrib["friction"]) == 0.4
    assert float(dynamics.attrib["damping"]) == pytest.approx(0.55)
    mass = float(document.find("link[@name='elbow_link']/inertial/mass").attrib["value"])
    link = document.find("link[@name='elbow_link']/inertial")
    centre = [float(x) for x in link.find("origin").attrib["xyz"].split()]
    reach = math.hypot(*centre)
    assert mass * GRAVITY * reach == pytest.approx(4.9 + 0.8 * GRAVITY * 0.25, rel=1e-6)
    about = float(link.find("inertia").attrib["ixx"]) + mass * reach**2
    assert about == pytest.approx(0.05 + 0.8 * 0.25**2, rel=1e-6)
