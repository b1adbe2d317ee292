"""A law that takes over a joint which holds some pressure leaves it where it is.

After a lowering that was cut short the muscles hold low and unequal pressures. The laws that keep a
mean pressure raise it then. The ratio of 42 and 10 kPa, kept while the mean rose to 230 kPa, threw
the elbow by 0.33 rad at 3.4 rad/s.
"""

from __future__ import annotations

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.laws.pressure_difference_pid import PressureDifferencePid
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.laws.registry import laws
from pam_control.settings import ControlSettings

HOLDING = ("model_based", "impedance", "pressure_difference_pid", "pressure_ratio_pid")
# spool commands and for how long [s] they act before the take-over
LEFT_OVER = {
    "none": (0.0, 0.0, 0.0),
    "low": (0.3, -0.3, 0.1),
    "low, other side": (-0.3, 0.3, 0.1),
    "one side": (0.3, -0.3, 0.5),
    "high": (0.3, 0.3, 0.5),
}


def left_with(loop, agonist: float, antagonist: float, duration: float) -> float:
    """Fill the muscles for some time [s], let the joint come to rest, return its position [rad]."""
    plant = loop.plants[0]
    for _ in range(round(duration * 1e3)):
        plant.step((agonist, antagonist), 1e-3)
    for _ in range(3000):
        loop._shown[0] = plant.step((0.0, 0.0), 1e-3)
    return plant.output["position"]


def moved(loop, start: float) -> tuple[float, float]:
    """Largest deviation [rad] and speed [rad/s] in the 3 s after the take-over."""
    position = loop.run(3.0).column(2)
    return np.abs(position - start).max(), np.abs(np.gradient(position, 2e-3)).max()


@pytest.mark.sampled("each law and each of the pressures that may be left")
@pytest.mark.parametrize("fill", LEFT_OVER.values(), ids=LEFT_OVER)
@pytest.mark.parametrize("law", HOLDING)
def test_the_joint_stays_where_it_is(rig, closed_loop, law, fill):
    loop = closed_loop(Controller(rig, ControlSettings(), law=laws()[law]()))
    deviation, speed = moved(loop, left_with(loop, *fill))
    assert deviation < 0.01
    assert speed < 0.05


@pytest.mark.parametrize("law", HOLDING)
def test_a_joint_that_is_not_as_its_rig_file_says_moves_little(rig, closed_loop, law):
    """A stiff bladder and a wrong sensor: the model's torque is wrong, nothing is thrown."""
    effects = {
        "agonist.bladder_elasticity.linear": 1500.0,
        "antagonist.pressure_gain.gain": 1.1,
        "antagonist.pressure_bias.bias": 5e3,
    }
    loop = closed_loop(Controller(rig, ControlSettings(), law=laws()[law]()), effects=effects)
    deviation, speed = moved(loop, left_with(loop, *LEFT_OVER["low"]))
    assert deviation < 0.05
    assert speed < 0.5


@pytest.mark.sampled("each law and each of the pressures once")
@pytest.mark.parametrize("law", [PressureDifferencePid, PressureRatioPid])
@pytest.mark.parametrize("mean", [1.6e5, 3.0e5])
def test_a_new_mean_pressure_leaves_a_turned_joint_where_it_is(rig, closed_loop, law, mean):
    controller = Controller(rig, ControlSettings(), law=law())
    loop = closed_loop(controller)
    start = left_with(loop, *LEFT_OVER["low"])
    loop.run(3.0)
    controller.change(ControlSettings(), law(mean_pressure=mean))
    deviation, _ = moved(loop, start)
    assert sum(loop.run(0.1).rows[-1][3:5]) == pytest.approx(2.0 * mean, rel=0.03)
    assert deviation < 0.02
