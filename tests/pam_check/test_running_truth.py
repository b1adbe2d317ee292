"""Plants in closed loop: sample by sample, they are those that make the recordings."""

import numpy as np
import pytest

from pam_check.blind.plants import PLANTS
from pam_check.blind.truth_plant import PressureExcitation, Sensors, TruthJoint, TruthMuscle
from pam_check.control.running_truth import RUNNING

JOINT = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
MUSCLE = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)
PERIOD, COUNT, PRESSURE = 0.002, 800, 2e5
HIDDEN = {
    "nothing": (JOINT, MUSCLE),
    "friction": (JOINT._replace(coulomb_torque=0.4, static_torque=0.6), MUSCLE),
    "late command": (JOINT, MUSCLE._replace(command_delay=0.013, thread_friction=0.003)),
}
pytest.importorskip("numba", reason="the plants are some 300 times slower without numba")


@pytest.mark.parametrize("name", list(PLANTS))
@pytest.mark.parametrize("hidden", list(HIDDEN))
def test_sample_by_sample_is_the_same_as_at_once(name, hidden):
    joint, muscle = HIDDEN[hidden]
    wave = 0.2 * np.sin(0.02 * np.arange(COUNT))
    commands = np.stack([wave, -wave], axis=1)
    level = np.full(COUNT, PRESSURE)
    recorded = PLANTS[name](
        joint,
        (muscle, muscle),
        PressureExcitation(level, np.zeros(COUNT), np.zeros(COUNT), PERIOD),
        Sensors(),
        np.random.default_rng(7),
        fixed_commands=np.round(commands / Sensors().command_step) * Sensors().command_step,
    )
    running = RUNNING[name](
        joint,
        (muscle, muscle),
        Sensors(),
        np.random.default_rng(7),
        period=PERIOD,
        count=COUNT,
        pressure=PRESSURE,
    )
    for first, second in commands:
        running.advance((float(first), float(second)))
    assert np.array_equal(running.truth[:, 2], recorded.true_position)
    assert np.array_equal(running.sensed[:, :2], recorded.pressures)
    assert np.array_equal(running.sensed[:, 2], recorded.position)
    assert np.ptp(recorded.position) > 0.05


def test_a_rig_that_changes_in_motion_goes_on_from_its_state():
    running = RUNNING["second"](
        JOINT,
        (MUSCLE, MUSCLE),
        Sensors(),
        np.random.default_rng(7),
        period=PERIOD,
        count=COUNT,
        pressure=PRESSURE,
    )
    for _ in range(100):
        running.advance((0.0, 0.0))
    at = float(running.truth[99, 2])
    running.becomes(JOINT._replace(gravity_torque=9.8, gravity_angle=0.3), (MUSCLE, MUSCLE))
    for _ in range(400):
        running.advance((0.0, 0.0))
    assert abs(running.truth[100, 2] - at) < 1e-3
    assert running.truth[499, 2] > at + 0.05
