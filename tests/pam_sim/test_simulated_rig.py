"""The rig as an object, as a program on a multicast bus, and what it says to bad input."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardState,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.can_bus.bus import open_bus
from pam_model.errors import PamError, RigError
from pam_model.rig import Encoder, save_rig
from pam_sim.boards.sensors import BoardSensors, SensorQuality
from pam_sim.simulated_rig import SimulatedRig, apply_effects
from support.rigs import ELBOW

QUIET = SensorQuality(0.0, 0.0, 0.0, 0.0)


class Host:
    """A driver in three lines: commands every 2 ms, measurements kept."""

    def __init__(self, rig: SimulatedRig):
        self.rig, self.codec = rig, BoardCodec.from_dbc()
        self.now, self.counter, self.heard = 0.0, 0, []

    def drive(self, duration, fractions, enable=(True, True)):
        """`fractions`: by board."""
        for k in range(round(duration / 0.001)):
            self.now += 0.001
            if k % 2 == 0:
                self.counter = (self.counter + 1) & 0xFF
                for board, pair in fractions.items():
                    message = ValveCommand(pair, enable, self.counter)
                    self.rig.on_frame(*self.codec.encode(board, message), self.now)
            for frame in self.rig.advance(self.now):
                self.heard.append((self.now, *self.codec.decode(*frame)))

    def measurements(self, board=0):
        return [m for _, b, m in self.heard if b == board and isinstance(m, Measurement)]


def started(simulated, boards=(0,)):
    host = Host(simulated)
    host.drive(0.1, dict.fromkeys(boards, (0.0, 0.0)), enable=(False, False))
    return host


@pytest.fixture(scope="session")
def two_joints(rig):
    """The elbow and a wrist on a second board, its muscles crossed on the channels."""
    wrist = replace(
        rig.joints[0], name="wrist", muscles=("wrist_flexor", "wrist_extensor"),
        encoder=Encoder(1), inertia=0.03,
    )  # fmt: skip
    more = tuple(
        replace(muscle, name=name, board=1, channel=channel)
        for muscle, name, channel in zip(rig.muscles, wrist.muscles, (1, 0), strict=True)
    )
    return replace(rig, joints=(*rig.joints, wrist), muscles=(*rig.muscles, *more))


def test_frames_move_the_arm_and_silence_vents_it(rig):
    simulated = SimulatedRig(rig, quality=QUIET)
    host = started(simulated)
    host.drive(0.3, {0: (0.3, 0.1)})
    truth = simulated.ground_truth()
    shown = host.measurements()[-1]
    assert truth.positions[0] > 0.2
    assert shown.position == pytest.approx(truth.positions[0], abs=5e-3)
    assert shown.pressures == pytest.approx(truth.pressures, abs=6e3)
    assert min(truth.forces) > 0.0
    host.drive(2.0, {})
    assert simulated.boards[0].state is BoardState.FAULT
    assert max(simulated.ground_truth().pressures) < 2e4


def test_two_joints_on_two_boards(two_joints):
    simulated = SimulatedRig(two_joints, quality=QUIET)
    host = started(simulated, (0, 1))
    # Board 1's channel 1 drives the wrist's flexor.
    host.drive(0.3, {0: (0.3, 0.0), 1: (0.3, 0.0)})
    elbow, wrist = simulated.ground_truth().positions
    assert elbow > 0.1
    assert wrist < -0.1
    assert host.measurements(1)[-1].position == pytest.approx(wrist, abs=1e-2)


def test_regulator_takes_fractions_of_full_scale(make_rig):
    valve = {"kind": "pressure_regulator", "full_scale": 5e5, "time_constant": 0.02}
    simulated = SimulatedRig(make_rig(valve=valve), quality=QUIET)
    host = started(simulated)
    host.drive(1.0, {0: (0.4, 0.4)})
    assert simulated.ground_truth().pressures == pytest.approx([2e5, 2e5], rel=1e-2)


def test_steps_do_not_depend_on_when_the_host_calls(rig):
    """A late caller gets the same plant: held commands, larger pieces."""

    def after(times):
        simulated = SimulatedRig(rig, quality=QUIET)
        codec = BoardCodec.from_dbc()
        simulated.advance(0.06)
        for counter, enable in enumerate(((False, False), (True, True))):
            frame = codec.encode(0, ValveCommand((0.4, 0.0), enable, counter))
            simulated.on_frame(*frame, 0.06)
        for now in times:
            simulated.advance(now)
        return simulated.ground_truth().positions[0]

    even = after(0.06 + 0.001 * np.arange(1, 81))
    assert even > 0.01
    assert after([0.0931, 0.0937, 0.14]) == pytest.approx(even, abs=1e-12)


def test_a_command_acts_from_when_it_arrived(rig):
    """Not from when a late host looked: the past would be driven by what came after it."""

    def after(seen):
        simulated = SimulatedRig(rig, quality=QUIET)
        codec = BoardCodec.from_dbc()
        simulated.advance(0.06)
        for counter, enable in enumerate(((False, False), (True, True))):
            simulated.on_frame(*codec.encode(0, ValveCommand((0.4, 0.0), enable, counter)), 0.06)
        simulated.advance(0.08)
        shut = codec.encode(0, ValveCommand((0.0, 0.0), (True, True), 2))
        simulated.on_frame(*shut, seen, seen - 0.085)
        simulated.advance(0.12)
        return simulated.ground_truth().pressures[0]

    at_once = after(0.085)
    assert at_once > 1e4
    assert after(0.115) == at_once
    assert after(0.0853) == at_once


def test_lost_time_is_told(rig):
    simulated = SimulatedRig(rig)
    simulated.advance(5.0)
    assert simulated.lost_time == pytest.approx(4.0, abs=0.01)


def test_droop_shows_in_the_status(rig):
    effects = {"supply_droop.conductance": 5e-10, "supply_droop.volume": 1e-4}
    simulated = SimulatedRig(rig, effects=effects, quality=QUIET)
    host = started(simulated)
    host.drive(0.3, {0: (1.0, 1.0)})
    status = [m for _, _, m in host.heard if isinstance(m, Status)][-1]
    assert status.supply_pressure < 6e5


def test_effects_reach_those_they_name(two_joints):
    effects = {
        "coulomb_friction.torque": 0.4,
        "wrist.viscous_friction.extra": 0.2,
        "elbow_extensor.leakage.conductance": 1e-11,
        "elbow.creep.ratio": 0.05,
    }
    elbow, wrist = apply_effects(two_joints, two_joints, effects)
    assert elbow["coulomb_friction.torque"] == wrist["coulomb_friction.torque"] == 0.4
    assert (elbow["viscous_friction.extra"], wrist["viscous_friction.extra"]) == (0.0, 0.2)
    assert elbow["agonist.leakage.conductance"] == 0.0
    assert elbow["antagonist.leakage.conductance"] == 1e-11
    assert elbow["agonist.creep.ratio"] == elbow["antagonist.creep.ratio"] == 0.05
    assert wrist["agonist.creep.ratio"] == 0.0


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"friction.torque": 1.0}, "unknown effect 'friction'"),
        ({"coulomb_friction": 1.0}, "expected <effect>.<parameter>"),
        ({"coulomb_friction.torque": -1.0}, r"N m is outside \[0, 1000\]"),
        ({"knee.coulomb_friction.torque": 1.0}, "unknown joint 'knee'"),
        ({"elbow.supply_droop.volume": 1e-3}, "an effect of the whole rig"),
        ({"knee.leakage.conductance": 1e-12}, "unknown joint or muscle 'knee'"),
    ],
)
def test_bad_effects_are_named(rig, effects, message):
    with pytest.raises(PamError, match=message):
        SimulatedRig(rig, effects=effects)


def test_another_rig_cannot_be_the_truth(rig, two_joints):
    with pytest.raises(RigError, match="true rig"):
        SimulatedRig(rig, truth=two_joints)


def test_noise_and_rounding_are_as_asked():
    sensors = BoardSensors(SensorQuality(300.0, 1e-3, 250.0, 0.0), (1, 2))
    pressures = np.array([sensors.pressure(1e5) for _ in range(20000)])
    positions = np.array([sensors.position(0.5) for _ in range(20000)])
    assert np.all(np.abs(pressures / 250.0 - np.round(pressures / 250.0)) < 1e-9)
    assert np.std(pressures) == pytest.approx(np.hypot(300.0, 250.0 / np.sqrt(12)), rel=0.03)
    assert np.mean(positions) == pytest.approx(0.5, abs=5e-5)
    assert np.std(positions) == pytest.approx(1e-3, rel=0.03)
    again = BoardSensors(SensorQuality(300.0, 1e-3, 250.0, 0.0), (1, 2))
    assert again.pressure(1e5) == pressures[0]
    with pytest.raises(PamError, match="pressure_noise"):
        SensorQuality(pressure_noise=-1.0)


PORT = 43000 + (int(time.time()) % 999)
BUS = ["--interface", "udp_multicast", "--channel", "239.74.163.2", "--port", str(PORT)]


@pytest.mark.sampled("one of the two signals, which one function answers", cases=1)
@pytest.mark.system
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_program_serves_a_bus_and_ends_on_a_signal(number):
    command = [sys.executable, "-m", "pam_sim", "rig", "--rig", str(ELBOW), *BUS]
    codec = BoardCodec.from_dbc()
    port = open_bus("udp_multicast", "239.74.163.2", port=PORT)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        counter, states, highest = 0, set(), 0.0
        end = time.monotonic() + 60.0
        while time.monotonic() < end and highest < 1e5:
            counter = (counter + 1) & 0xFF
            on = BoardState.VENTED in states
            message = ValveCommand((0.5, 0.5) if on else (0.0, 0.0), (on, on), counter)
            port.send(*codec.encode(0, message), time.monotonic())
            for frame in port.receive_all(time.monotonic()):
                if frame.frame_id == codec.frame_id(ValveCommand, 0):
                    continue
                _, heard = codec.decode(frame.frame_id, frame.data)
                if isinstance(heard, Status):
                    states.add(heard.state)
                elif isinstance(heard, Measurement):
                    highest = max(highest, heard.pressures[0])
            time.sleep(0.002)
        assert BoardState.ACTIVE in states
        assert highest >= 1e5
        process.send_signal(number)
        assert process.wait(20) == 0
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        process.wait()
        port.close()


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--rig", "/nowhere/rig.yaml"], "/nowhere/rig.yaml"),
        (["--rig", str(ELBOW), "--effect", "coulomb_friction.torque"], "--effect"),
        (["--rig", str(ELBOW), "--effect", "wind.force=3"], "unknown effect 'wind'"),
        (["--rig", str(ELBOW), "--rate", "1e6"], "--rate"),
        (["--rig", str(ELBOW), "--pressure-noise", "-3"], "--pressure-noise"),
        (["--rig", str(ELBOW), "--interface", "socketcan", "--channel", "can77"], "can77"),
        (["--rig", str(ELBOW), "--interface", "pigeon"], "pigeon"),
    ],
)
def test_program_names_bad_input(extra, message, capsys):
    from pam_sim.__main__ import main

    assert main(["rig", *extra]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert "Traceback" not in told


def test_true_rig_file_is_the_plant(rig, tmp_path, make_rig):
    truth = tmp_path / "true.yaml"
    loaded = {"payload": {"mass": 1.0, "distance": 0.2}, "coulomb_friction": {"torque": 0.3}}
    save_rig(make_rig(joint={"effects": loaded}), truth)
    from pam_model.rig import load_rig

    simulated = SimulatedRig(rig, truth=load_rig(truth))
    heavier = simulated.parameters[0]["joint.inertia"] - rig.joints[0].inertia
    assert heavier == pytest.approx(0.04)
    assert simulated.parameters[0]["coulomb_friction.torque"] == 0.3
