"""The start-up check on simulated rigs, healthy and with defects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pam_driver.driver import ActivationError
from pam_driver.safety.start_up_check import (
    ABORT_ANGLE,
    StartUpCheck,
)
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand
from pam_model.rig import PressureSensor, Rig, load_rig
from pam_model.robot import compose
from pam_sim.faults.rig_faults import constant, stuck

from .node_bench import ROOT
from .start_up_bench import PATIENCE, Bench, exchanged, free_rig

ELBOW, TWO_JOINTS = ROOT / "config/elbow.yaml", ROOT / "config/two_joints.yaml"


@pytest.fixture
def elbow(rig: Rig) -> Rig:
    return rig


@pytest.mark.parametrize("path", [ELBOW, TWO_JOINTS], ids=lambda path: path.stem)
def test_a_healthy_rig_passes_and_hardly_moves(path: Path) -> None:
    """Flow valves and pressure regulators."""
    bench = Bench(load_rig(path))
    assert bench.check() == []
    assert bench.driver.state is SafetyState.READY
    assert bench.moved < ABORT_ANGLE
    assert bench.highest < 2e4
    assert not bench.driver.faults


@pytest.mark.sampled("three of the seven small defects", cases=3)
@pytest.mark.parametrize(
    "effects",
    [
        {"valve_dead_zone.overlap": 0.1},
        {"valve_null_offset.offset": -0.05},
        {"exhaust_restriction.ratio": 0.4},
        {"coulomb_friction.torque": 0.5},
        {"payload.mass": 1.0},
        {"pressure_bias.bias": 5e3},
        {"pressure_lag.time_constant": 0.03},
    ],
    ids=lambda effects: next(iter(effects)),
)
def test_a_rig_that_is_only_rough_passes(elbow: Rig, effects: dict[str, float]) -> None:
    bench = Bench(elbow, effects=effects)
    assert bench.check() == []
    assert bench.moved < ABORT_ANGLE


def test_exchanged_pressure_sensors_are_named(elbow: Rig) -> None:
    bench = Bench(elbow)
    bench.sim.faults.swapped.add(0)
    first, second = bench.check()
    assert first.startswith(
        "elbow_flexor: its valve (board 0, channel 0) raises the pressure of elbow_extensor: the "
        "pressure sensor (board 0, channel 0) and the pressure sensor (board 0, channel 1)"
    )
    assert first.endswith("are exchanged")
    assert second.startswith("elbow_extensor: ")
    assert bench.moved < ABORT_ANGLE


def test_hoses_that_are_crossed_before_the_sensors_are_named(elbow: Rig) -> None:
    bench = Bench(elbow, exchanged(elbow))
    bench.sim.faults.swapped.add(0)
    first, _ = bench.check()
    assert first.startswith("elbow_flexor: its valve (board 0, channel 1) raises the pressure of")
    assert "its hose and that of elbow_extensor are crossed" in first


def test_hoses_that_are_crossed_behind_the_sensors_are_named(elbow: Rig) -> None:
    """Each valve belongs to its sensor, but the joint turns the wrong way."""
    bench = Bench(elbow, exchanged(elbow))
    first, second = bench.check()
    assert "the wrong way: hoses are crossed behind the pressure sensor" in first
    assert first.startswith("elbow_flexor: ")
    assert second.startswith("elbow_extensor: ")


@pytest.mark.parametrize(("valve", "opening"), [(0, 0.0), (1, -1.0)], ids=["shut", "exhausting"])
def test_a_valve_that_does_not_open_is_named(elbow: Rig, valve: int, opening: float) -> None:
    bench = Bench(elbow)
    bench.sim.faults.valves[0, valve] = opening
    (found,) = bench.check()
    assert found.startswith(f"{elbow.muscles[valve].name}: its pressure sensor (board 0, channel")
    assert f"its valve (board 0, channel {valve}) is stuck shut" in found
    assert bench.driver.state is SafetyState.FAULT


@pytest.mark.parametrize("sensor", [0, 1])
def test_a_sensor_that_shows_nothing_is_named_before_the_joint_has_moved_far(
    elbow: Rig, sensor: int
) -> None:
    """The valve would fill the muscle more and more: the joint's angle ends the pulse."""
    bench = Bench(elbow)
    bench.sim.faults.sensors[0, sensor] = stuck()
    (found,) = bench.check()
    assert found.startswith(f"{elbow.muscles[sensor].name}: ")
    assert "the sensor is dead" in found
    bench.run(lambda: bench.driver.faults == () or bench.now > 6.0)
    assert bench.moved < 2.0 * ABORT_ANGLE


def test_a_sensor_that_shows_pressure_in_an_empty_muscle_prevents_the_activation(
    elbow: Rig,
) -> None:
    bench = Bench(elbow)
    bench.sim.faults.sensors[0, 1] = constant(5e4)
    bench.run(lambda: bench.now > 0.6)
    with pytest.raises(ActivationError, match="elbow_extensor"):
        bench.driver.activate(bench.now)


def test_a_pressure_regulator_that_does_not_open_is_named() -> None:
    rig = load_rig(TWO_JOINTS)
    (muscle,) = [muscle for muscle in rig.muscles if muscle.name == "elbow_flexor"]
    assert muscle.valve.kind == "pressure_regulator"
    bench = Bench(rig)
    assert muscle.board is not None
    bench.sim.faults.valves[muscle.board, 0] = 0.0
    (found,) = bench.check()
    assert found.startswith("elbow_flexor: its pressure sensor")
    assert "is stuck shut" in found


def test_a_sensor_on_another_board_is_named_there(elbow: Rig) -> None:
    flexor, extensor = elbow.muscles
    apart = replace(flexor, pressure_sensor=PressureSensor(7, 3))
    check = StartUpCheck(compose(replace(elbow, muscles=(apart, extensor))), (-1.0, -1.0))
    check.start(0.0)
    now = 0.0
    while not check.findings:
        now += 0.002
        check.setpoints((0.0, 0.0), (0.0,), now)
        assert now < PATIENCE
    assert "its pressure sensor (board 7, channel 3) shows no pressure" in check.findings[0].text
    assert "its valve (board 0, channel 0) is stuck shut" in check.findings[0].text


def test_no_command_is_taken_while_the_valves_are_tested(elbow: Rig) -> None:
    bench = Bench(elbow)
    bench.run(lambda: bench.now > 0.6)
    bench.driver.activate(bench.now)
    bench.run(lambda: bench.now > 1.0)
    command = NamedCommand(elbow.muscle_names, (0.5, 0.5))
    with pytest.raises(CommandRefusedError, match="the start-up check tests the valves"):
        bench.driver.set_commands(command, bench.now)
    bench.driver.vent(bench.now)
    bench.run(lambda: bench.driver.state is SafetyState.VENTED)
    bench.driver.activate(bench.now)
    assert bench.driver.state is SafetyState.CHECKING, "a stop ends the check, and it begins anew"


def test_a_command_from_before_the_end_of_the_check_is_refused(elbow: Rig) -> None:
    bench = Bench(elbow)
    assert bench.check() == []
    command = NamedCommand(elbow.muscle_names, (0.5, 0.5), age=0.05)
    with pytest.raises(CommandRefusedError, match="computed before the driver was activated"):
        bench.driver.set_commands(command, bench.now)
    bench.driver.set_commands(command._replace(age=0.0), bench.now)
    assert bench.driver.state is SafetyState.ACTIVE


# torque [N m], length of the muscles [m], inertia [kg m^2]
FREE = [(0.1, 0.08, 2e-5), (1.0, 0.12, 4e-3), (30.0, 0.3, 0.12), (300.0, 0.6, 1.2)]


@pytest.mark.sampled("every size and every weight once")
@pytest.mark.parametrize("size", FREE, ids=lambda size: f"{size[0]:g} N m")
@pytest.mark.parametrize("weight", [0.0, 0.02, 0.1, 0.5])
def test_joints_of_all_sizes_pass_whether_or_not_gravity_holds_them(
    tmp_path: Path, size: tuple[float, float, float], weight: float
) -> None:
    """A horizontal joint turned by 0.15 rad at 8 kPa, and could not be started."""
    rig = free_rig(tmp_path, *size)
    joint = replace(rig.joints[0], gravity_torque=weight * size[0])
    bench = Bench(rig.with_joint(joint))
    assert bench.check() == []
    assert bench.moved < 0.25


@pytest.mark.sampled("two of the four sizes of joints", cases=2)
@pytest.mark.parametrize("size", FREE, ids=lambda size: f"{size[0]:g} N m")
def test_defects_of_a_free_joint_are_named(
    tmp_path: Path, size: tuple[float, float, float]
) -> None:
    rig = free_rig(tmp_path, *size)
    crossed = Bench(rig, exchanged(rig))
    assert "the wrong way: hoses are crossed behind" in crossed.check()[0]
    sensors = Bench(rig)
    sensors.sim.faults.swapped.add(0)
    assert sensors.check()[0].endswith("are exchanged")
    dead = Bench(rig)
    dead.sim.faults.sensors[0, 0] = stuck()
    assert dead.check()[0].endswith("the sensor is dead")
    shut = Bench(rig)
    shut.sim.faults.valves[0, 0] = 0.0
    assert "is stuck shut" in shut.check()[0]
