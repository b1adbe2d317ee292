"""The reservoir of the controller: one for all joints, by the formula."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.settings import ControlSettings
from pam_model.gas import GAS_CONSTANT, mass_flow
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose

TWO_JOINTS = Path(__file__).parents[2] / "config/two_joints.yaml"
DROOP = {"supply_droop": {"conductance": 5e-10, "volume": 3e-4}}


@pytest.fixture(scope="module")
def rig() -> Rig:
    return replace(load_rig(TWO_JOINTS), effects=DROOP)


def test_the_flows_of_all_muscles_add_up(rig: Rig) -> None:
    gas, droop = rig.gas, DROOP["supply_droop"]
    reservoir = SupplyReservoir(compose(rig))
    expected = rig.supply_pressure
    for flows in ((1e-3, 2e-3), (3e-3, 0.0), (0.0, 5e-4)):
        for flow in flows:
            reservoir.draw(flow)
        refill = mass_flow(
            droop["conductance"],
            rig.muscles[0].valve.critical_ratio,
            rig.supply_pressure,
            expected,
            gas.temperature,
        )
        heat = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature
        expected += 2e-3 * heat * (float(refill) - sum(flows)) / droop["volume"]
        reservoir.advance(2e-3)
        assert reservoir.pressure == pytest.approx(expected, rel=1e-9)


def flow_valves(rig: Rig) -> Rig:
    """Both joints with the valves of the one that has flow valves."""
    flow = next(m.valve for m in rig.muscles if m.valve.kind == "flow")
    return replace(rig, muscles=tuple(replace(m, valve=flow) for m in rig.muscles))


def test_a_joint_that_draws_takes_supply_from_the_other(rig: Rig) -> None:
    controller = Controller(flow_valves(rig), ControlSettings())
    count = len(rig.muscles)
    sag = []
    for cycle in range(40):
        time = 2e-3 * cycle
        # the muscles of the first joint are much emptier than they should be, and never fill
        pressures = [1e5 if cycle == 0 or place >= 2 else 1e4 for place in range(count)]
        controller.step(time, Measurement([0.0, 0.0], pressures, time, time))
        sag.append(controller.reservoir.pressure)
    assert sag[-1] < rig.supply_pressure - 2e4
