"""The command check-rig: wiring, bus load, promises, and refusals without a bus."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from pam_driver.__main__ import main
from pam_driver.bus_load import bus_load, classic_bits, frame_time
from pam_driver.can_bus.identifiers import EXTENDED, FD
from pam_driver.tools.check_rig import check_rig
from pam_model.rig import Bus, Encoder, Rig, load_rig, save_rig
from pam_model.robot import compose
from pam_model.views.pull_over_travel import slack_muscles
from support.rigs import CONFIG, ELBOW

MISTAKE, BAD_NEWS = 2, 1


def arm_of(boards: int) -> Rig:
    """So many elbows, each with its own valve board."""
    elbow = load_rig(ELBOW)
    joints, muscles = [], []
    for number in range(boards):
        names = tuple(f"{name}_{number}" for name in elbow.joints[0].muscles)
        encoder = Encoder(number, 0)
        joints.append(replace(elbow.joints[0], name=f"j{number}", muscles=names, encoder=encoder))
        muscles += [
            replace(muscle, name=name, board=number)
            for name, muscle in zip(names, elbow.muscles, strict=True)
        ]
    return replace(elbow, joints=tuple(joints), muscles=tuple(muscles))


@pytest.mark.parametrize(
    ("frame_id", "length", "bits"), [(0x100, 8, 135), (0x100, 0, 55), (EXTENDED | 1, 8, 160)]
)
def test_a_classic_frame_has_the_bits_of_the_literature(
    frame_id: int, length: int, bits: int
) -> None:
    assert classic_bits(frame_id, length) == bits


def test_a_frame_of_can_fd_takes_less_time_than_its_bytes_in_classic_frames() -> None:
    bus = Bus(bitrate=500_000, fd=True, data_bitrate=2_000_000)
    fd, classic = frame_time(0x100 | FD, 64, bus), 8 * frame_time(0x100, 8, bus)
    assert 64 * 8 / 2e6 < fd < classic / 3


def test_seven_boards_are_too_much_for_one_bus_and_six_are_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for boards, code in ((6, 0), (7, BAD_NEWS)):
        path = tmp_path / f"{boards}.yaml"
        save_rig(arm_of(boards), path)
        assert main(["check-rig", str(path), "--check"]) == code
        shown = capsys.readouterr()
        assert ("7 boards at 500 Hz take 100 % of 1000 kbit/s" in shown.err) is (boards == 7)
        assert main(["check-rig", str(path)]) == 0
        capsys.readouterr()


def test_half_the_bitrate_doubles_the_load() -> None:
    rig = load_rig(CONFIG / "elbow_vendor_dbc.yaml")
    loads = [check_rig(rig, Bus(bitrate=rate), 500.0).loads[""] for rate in (1_000_000, 500_000)]
    assert loads[0] is not None and loads[1] == pytest.approx(2.0 * loads[0])
    assert bus_load([], Bus()) == 0.0


def test_measurements_that_come_too_rarely_are_named(tmp_path: Path) -> None:
    rig = load_rig(CONFIG / "elbow_vendor_dbc.yaml")
    section = rig.boards["manifold"]
    answers = {**section["answers"], "PVM_Joint": {"counter": "Roll_Cnt", "period": 0.1}}
    slow = replace(rig, boards={"manifold": {**section, "answers": answers}})
    assert check_rig(rig, Bus(), 500.0).problems == []
    assert check_rig(slow, Bus(), 500.0).problems == [
        "board manifold: PVM_Joint comes every 100 ms, but sensor_timeout of the driver is 50 ms "
        "by default, and the driver would vent"
    ]


def test_the_table_says_what_each_muscle_is_wired_to(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-rig", str(CONFIG / "two_buses.yaml"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    wires = {(wire["name"], wire["what"]): wire for wire in document["wires"]}
    assert len(wires) == 10
    flexor = wires["elbow_flexor", "pressure"]
    assert (flexor["bus"], flexor["signal"]) == ("vendor", "PVM_Actual.P_Act_A")
    assert wires["shoulder_extensor", "setpoint"]["signal"] == "ValveCommand.Valve1"
    assert set(document["bus_load"]) == {"boards", "vendor"}
    assert document["problems"] == []
    (missing,) = document["missing_promises"]["board manifold"]
    assert missing.startswith("no memory for a fault of the host")


def test_a_rig_that_the_driver_would_refuse_is_a_mistake_that_names_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (CONFIG / "elbow_vendor_dbc.yaml").read_text()
    text = text.replace("pneumatic_manifold.dbc", str(CONFIG / "pneumatic_manifold.dbc"), 2)
    path = tmp_path / "wrong.yaml"
    path.write_text(text.replace("PVM_Demand.P_Dem_A, unit: bar", "PVM_Demand.P_Dem_A, unit: psi"))
    assert main(["check-rig", str(path)]) == MISTAKE
    shown = capsys.readouterr()
    assert shown.err == (
        f"error: {path}: boards.manifold.setpoints.port_a.unit = psi: the DBC file says bar for "
        "PVM_Demand.P_Dem_A\n"
    )


def test_a_supply_above_the_largest_pressure_is_a_caution(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A valve that sticks open fills its muscle up to the supply, whatever the driver does."""
    rig = load_rig(ELBOW)
    assert check_rig(rig, Bus(), 500.0).cautions == []
    path = tmp_path / "rig.yaml"
    save_rig(rig.with_muscle(replace(rig.muscles[1], max_pressure=4e5)), path)
    assert main(["check-rig", str(path), "--check"]) == 0
    shown = capsys.readouterr().out
    assert "CAUTION: the supply of 600000 Pa gauge is above the max_pressure of elbow_ext" in shown
    assert "(from 400000 Pa)" in shown
    # an identified supply differs by a hair
    for over, said in ((0.95, 1), (0.995, 0), (1.005, 0), (1.05, 1)):
        near = replace(rig, supply_pressure=rig.gas.ambient_pressure + over * 6e5)
        near = replace(near, parameter_tolerance=0.3)  # that of a rough file excuses nothing
        assert len(check_rig(near, Bus(), 500.0).cautions) == said


@pytest.mark.parametrize("key", ["max_pressure", "valve.full_scale"])
def test_a_supply_that_seems_to_be_written_as_gauge_is_a_caution(key: str) -> None:
    """What counts on 6 bar with a supply of 6 bar absolute would be right if that were gauge."""
    rig = replace(load_rig(CONFIG / "elbow_canopen_regulator.yaml"), supply_pressure=600000.0)
    if key == "max_pressure":
        for muscle in rig.muscles:
            valve = replace(muscle.valve, full_scale=4e5)
            rig = rig.with_muscle(replace(muscle, valve=valve))
    else:
        for muscle in rig.muscles:
            rig = rig.with_muscle(replace(muscle, max_pressure=498675.0))
    (caution,) = check_rig(rig, Bus(), 500.0).cautions
    assert f"elbow_flexor.{key}, elbow_extensor.{key} (up to 600000 Pa gauge)" in caution
    assert "if 600000 Pa are what a gauge shows, write 701325" in caution
    absolute = check_rig(replace(rig, supply_pressure=701325.0), Bus(), 500.0)
    assert "what a gauge shows" not in str(absolute.cautions)


def test_a_weight_that_the_muscles_cannot_hold_is_a_caution() -> None:
    rig = load_rig(ELBOW)
    heavy = rig.with_joint(replace(rig.joints[0], gravity_torque=60.0))
    (caution,) = check_rig(heavy, Bus(), 500.0).cautions
    assert caution.startswith("elbow: at -")
    assert "the joint cannot stay at this angle" in caution
    upside_down = rig.with_joint(replace(rig.joints[0], gravity_torque=-60.0))
    assert len(check_rig(upside_down, Bus(), 500.0).cautions) == 1


@pytest.mark.parametrize(
    ("neutral_length", "share"), [(0.12, "at every angle"), (0.18, "at some angles"), (0.19, "")]
)
def test_a_muscle_that_cannot_pull_is_refused_with_the_length_that_helps(
    neutral_length: float, share: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, path = load_rig(ELBOW), tmp_path / "rig.yaml"
    for muscle in rig.muscles:
        rig = rig.with_muscle(replace(muscle, neutral_length=neutral_length))
    save_rig(rig, path)
    assert main(["check-rig", str(path)]) == (MISTAKE if share else 0)
    shown = capsys.readouterr().err
    for muscle in rig.muscles if share else ():
        expected = f"{path}: {muscle.name}.neutral_length = {neutral_length:g} m: {share} of elbow"
        assert f"{expected} the muscle pulls 0 N, although it has 600000 Pa gauge" in shown
        assert "use a neutral_length of 0.189" in shown


def test_a_muscle_that_pulls_at_no_length_needs_more_pressure() -> None:
    robot = compose(load_rig(ELBOW))
    weak = replace(robot.supply, pressure=robot.gas.ambient_pressure)
    lines = slack_muscles(replace(robot, supply=weak))
    assert len(lines) == 2
    assert all("would pull at no length; raise max_pressure and supply" in line for line in lines)
