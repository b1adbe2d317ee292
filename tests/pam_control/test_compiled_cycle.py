"""The compiled control cycle: equal to plain Python, ready before the first cycle, any muscle."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.joints.affine_inverse import affine_line, affine_pressures
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig, load_rig, rig_from_parameters

CONFIG = Path(__file__).parents[2] / "config"
PERIOD, CYCLES = 0.002, 120
FRICTION = {"hysteresis": {"amplitude": 0.08}, "creep": {"ratio": 0.3, "time_constant": 3.0}}


def rigs() -> dict[str, Rig]:
    """Robots that go through all branches."""
    elbow = load_rig(CONFIG / "elbow.yaml")
    late = {
        "pressure_lag": {"time_constant": 0.02},
        "valve_dead_zone": {"overlap": 0.05},
        "leakage": {"conductance": 3e-11},
        "tube_restriction": {"conductance": 1e-8, "volume": 1e-5},
    }
    joint = {"coulomb_friction": {"torque": 0.5}, "position_delay": {"delay": 0.01}}

    def told(muscles: dict[str, dict[str, float]], joint: dict[str, dict[str, float]]) -> Rig:
        rig = elbow.with_joint(dataclasses.replace(elbow.joints[0], effects=joint))
        for name in rig.muscle_names:
            rig = rig.with_muscle(dataclasses.replace(rig.muscle(name), effects=muscles))
        return rig

    return {
        "elbow": elbow,
        "two joints": load_rig(CONFIG / "two_joints.yaml"),
        "friction": told(FRICTION, joint),
        "late": told(late, {}),
        "cable": told({"cable_compliance": {"compliance": 2e-6}}, {}),
    }


def commands(name: str, designs: KeptDesigns | None = None) -> list[list[float]]:
    """Commands and desired pressures of a motion, without a plant; what is learnt is used."""
    # designed for one stiffness, which is quicker, but for the elbow's gains, which depend on it
    grid = () if name == "elbow" else (14.0,)
    return commands_of(rigs()[name], grid=grid, designs=designs)


def commands_of(
    rig: Rig,
    *,
    adapts: bool = True,
    grid: tuple[float, ...] = (),
    designs: KeptDesigns | None = None,
) -> list[list[float]]:
    """The same of any rig, whose muscles are measured in the order of the joints."""
    settings = ControlSettings(
        observer=True, observer_bandwidth=5.0, adaptation=adapts, stiffness_grid=grid
    )
    controller, rows = Controller(rig, settings, designs=designs), []
    count = len(rig.joints)
    order = [rig.muscle_names.index(name) for joint in rig.joints for name in joint.muscles]
    for cycle in range(CYCLES):
        now = 1.0 + cycle * PERIOD
        q = 0.3 * math.sin(8.0 * cycle * PERIOD)
        pressures = [0.0] * len(rig.muscles)
        for number, place in enumerate(order):
            pressures[place] = 2e5 + 4e4 * math.sin(11.0 * now + number)
        if cycle == 20:
            points = [TrajectoryPoint(0.3, [0.2] * count, [0.0] * count)]
            controller.references.follow(rig.joint_names, points, start=None, now=now)
        if cycle > 80 and cycle % 5 == 0:
            controller.references.stream(rig.joint_names, [0.2 - 1e-3 * cycle] * count, now=now)
        output = controller.step(now, Measurement([q] * count, pressures, now - 1e-3, now - 1e-3))
        assert output.commands is not None, output.reason
        assert sum(map(math.isnan, output.commands)) == len(rig.muscles) - len(order)
        row = [output.commands[place] for place in order]
        for joint in output.joints:
            row += [*joint.pressures, joint.torque, joint.reference.position]
        rows.append(row)
    return rows


@pytest.mark.skipif(not HAVE_NUMBA, reason="needs numba")
def test_plain_python_gives_the_same_commands(
    shared_designs: KeptDesigns, designs_folder: Path
) -> None:
    """In a process of its own, because the package decides at its import.

    It reads the gains that are designed here: to design them again would take most of its time.
    """
    compiled = {name: np.array(commands(name, shared_designs)) for name in rigs()}
    program = (
        "import json, pathlib, sys; from test_compiled_cycle import KeptDesigns, commands, rigs;"
        "kept = KeptDesigns(pathlib.Path(sys.argv[1]));"
        "json.dump({name: commands(name, kept) for name in rigs()}, sys.stdout)"
    )
    environment = {**os.environ, "PAM_NO_NUMBA": "1"}
    folder = os.pathsep.join((str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, "-c", program, str(designs_folder)],
        env={**environment, "PYTHONPATH": folder},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    for name, plain in json.loads(done.stdout).items():
        mine = compiled[name]
        assert np.abs(mine).max() > 0.0
        close = np.abs(mine - plain) <= 1e-12 * np.maximum(np.abs(mine), 1.0)
        assert close[:40].all(), name
        # fits of what is learnt solve equations, which amplify the last digit
        assert mine == pytest.approx(np.array(plain), rel=1e-9, abs=1e-9), name


def test_the_order_of_the_muscles_in_the_rig_file_does_not_matter() -> None:
    """Nothing is learnt here: when a valve is fitted depends on its place."""
    rig = rigs()["two joints"]
    first, second, third, fourth = rig.muscles
    mixed = dataclasses.replace(rig, muscles=(fourth, second, first, third))
    assert np.array(commands_of(mixed, adapts=False)) == pytest.approx(
        np.array(commands_of(rig, adapts=False)), rel=1e-9, abs=1e-9
    )


def test_a_muscle_that_turns_no_joint_gets_no_command() -> None:
    rig = rigs()["two joints"]
    spare = dataclasses.replace(rig.muscles[0], name="spare")
    more = dataclasses.replace(rig, muscles=(rig.muscles[0], spare, *rig.muscles[1:]))
    assert commands_of(more, adapts=False) == commands_of(rig, adapts=False)


def test_nothing_is_compiled_in_a_cycle() -> None:
    """A first cycle that compiles would take seconds, with air in the muscles."""
    numba = pytest.importorskip("numba")
    controller = Controller(rigs()["elbow"], ControlSettings())
    compiled = []
    event = numba.core.event

    class Listener(event.Listener):
        def on_start(self, _):
            compiled.append("start")

        def on_end(self, _):
            compiled.append("end")

    with event.install_listener("numba:compile", Listener()):
        for cycle in range(5):
            now = 1.0 + cycle * PERIOD
            controller.step(now, Measurement([0.1], [2e5, 2e5], now, now))
    assert not compiled


@pytest.mark.parametrize("position", [-0.7, 0.0, 0.4])
@pytest.mark.parametrize("torque", [-40.0, -1.0, 0.0, 3.0, 40.0])
@pytest.mark.parametrize("stiffness", [0.0, 8.0, 1e3])
def test_the_inverse_of_rows_is_that_of_the_joint(
    rig: Rig, position: float, torque: float, stiffness: float
) -> None:
    joint = JointStatics.from_rig(rig, 0, min_pressure=5e3)
    lines = []
    pair = zip(joint.muscles, joint.lengths(position), strict=True)
    for muscle, length in pair:
        model = muscle.affine_model
        assert model is not None
        lines.append(
            affine_line(
                *model.coefficients(length), *model.coefficient_slopes(length),
                muscle.low_pressure, muscle.high_pressure,
            )
        )  # fmt: skip
    expected = joint.pressures_for(torque, stiffness, position)
    found = affine_pressures(lines[0], lines[1], joint.radius, torque, stiffness)
    assert found[:4] == pytest.approx(
        (expected.agonist, expected.antagonist, expected.torque, expected.stiffness), rel=1e-12
    )
    assert found[4:] == (expected.torque_limited, expected.stiffness_limited)


def test_a_history_that_is_full_grows() -> None:
    """At 2 kHz with measurements that are half a second late, nothing is lost."""
    rig = rig_from_parameters(load_rig(CONFIG / "elbow.yaml").to_parameters())
    slow = ControlSettings(stale_after=1.0, period=0.0005, extra_delay=0.0)
    controller = Controller(rig, slow)
    for cycle in range(3000):
        now = 1.0 + cycle * 0.0005
        seen = Measurement([0.1], [2e5, 2e5], now - 0.9, now - 0.9)
        assert controller.step(now, seen).commands is not None
    references = controller.references.limited_references
    assert len(references.history) >= references.ends[1] > 1000
