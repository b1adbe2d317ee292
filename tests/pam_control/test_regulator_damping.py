"""Gains for regulators are designed with their damping, and references lead by their delay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.feedback.closed_loop import state_space
from pam_control.feedback.linear_joint import LoopTiming, frequency_response
from pam_control.settings import ControlSettings
from pam_model.rig import Rig, load_rig
from support.rigs import ELBOW

CORNER = 74.0  # rad/s


def regulated(rig: Rig, damping: float) -> Rig:
    for muscle in rig.muscles:
        valve = replace(
            muscle.valve, kind="pressure_regulator", time_constant=1.0 / CORNER,
            full_scale=muscle.max_pressure, damping=damping,
        )  # fmt: skip
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


@pytest.fixture(scope="module")
def controllers() -> dict[float, Controller]:
    """By damping; a design takes seconds."""
    elbow = load_rig(ELBOW)
    return {
        damping: Controller(regulated(elbow, damping), ControlSettings(stiffness_grid=(14.0,)))
        for damping in (0.65, 1.0)
    }


@pytest.mark.parametrize("damping", [0.65, 1.0])
def test_both_forms_of_the_linear_loop_agree(
    controllers: dict[float, Controller], damping: float
) -> None:
    controller = controllers[damping]
    case = controller.design.cases(controller.channels[0].models, controller.settings)[0]
    timing = controller.design.timing(controller.channels[0].models, controller.settings)
    assert timing.valve_damping == damping
    omega = np.geomspace(0.1, 60.0, 40)
    exact = frequency_response(case.point, case.loop, timing, omega)
    pade = state_space(case.point, case.loop, timing)(1j * omega)
    assert np.max(np.abs(pade / exact - 1.0)) < 1e-3


def test_at_its_corner_a_regulator_gives_one_over_twice_its_damping(
    controllers: dict[float, Controller],
) -> None:
    controller = controllers[0.65]
    case = controller.design.cases(controller.channels[0].models, controller.settings)[0]
    omega = np.array([CORNER])
    # only the way from the pressures to the joint, without the way back from its position
    loop = replace(case.loop, position_feedback=(0.0, 0.0))
    plain = LoopTiming(0.002, 0.004, 1.0 / CORNER, 1.0, 0.01, regulated=True)
    found = [
        abs(frequency_response(case.point, loop, replace(plain, valve_damping=zeta), omega)[0])
        for zeta in (0.65, 1.0)
    ]
    assert found[0] / found[1] == pytest.approx(1.0 / 0.65, rel=1e-6)


def test_references_of_a_regulator_lead_by_the_delay_of_its_poles(
    controllers: dict[float, Controller],
) -> None:
    delays = {}
    for damping, controller in controllers.items():
        settings = controller.settings
        delays[damping] = controller.channels[0].setup.acting_delays[0]
        soon = settings.command_delay + 0.5 * settings.period
        assert delays[damping] - soon == pytest.approx(2.0 * damping / CORNER)
        shown = Measurement([0.0], [2e5, 2e5], 0.0, 0.0)
        assert controller.step(0.0, shown).commands is not None
    assert delays[0.65] < delays[1.0]
