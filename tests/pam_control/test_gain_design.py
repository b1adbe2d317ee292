"""Gains: margins kept, unsafe ones refused, and the linear model against the simulated plant."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

from pam_control.controller import MODEL_BASED, Controller
from pam_control.feedback.closed_loop import is_stable, state_space
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.linear_joint import LoopTiming, frequency_response
from pam_control.feedback.margins import ControlDesignError, margins, pid_response
from pam_control.feedback.pid import PidGains, integrate, pid_output
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.laws.registry import laws
from pam_control.settings import ControlSettings
from pam_model.errors import RigError
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import load_rig
from pam_model.robot import compose
from pam_model.views.inverse_dynamics import InverseDynamics
from pam_model.views.linearised_joint import operating_point
from support.feedback_rows import feedback
from support.rigs import CONFIG

TWO_JOINTS = CONFIG / "two_joints.yaml"

LAWS = [
    (MODEL_BASED, True),
    (MODEL_BASED, False),
    (PressureRatioPid(), True),
]


@pytest.mark.parametrize(("law", "feedforward"), LAWS)
def test_designed_gains_keep_the_margins_everywhere(rig, law, feedforward):
    controller = Controller(rig, ControlSettings(feedforward=feedforward), law=law)
    for found in controller.channels[0].setup.margins:
        assert found.stable
        assert found.phase_margin > math.radians(49.0)
        assert found.modulus_margin > 1.0 / 1.65
        assert found.gain_margin > 2.0


@pytest.mark.parametrize("late", [0.0, 0.005])
@pytest.mark.parametrize(("law", "feedforward"), LAWS)
def test_exact_delay_and_pade_agree(rig, law, feedforward, late):
    controller = Controller(rig, ControlSettings(feedforward=feedforward), law=law)
    channel, settings = controller.channels[0], controller.settings
    timing = replace(
        controller.design.timing(channel.models, settings), pressure_delay=late, position_delay=late
    )
    omega = np.geomspace(0.1, 150.0, 40)
    for case in controller.design.cases(channel.models, settings):
        exact = frequency_response(case.point, case.loop, timing, omega)
        pade = state_space(case.point, case.loop, timing)(1j * omega)
        assert np.max(np.abs(pade / exact - 1.0)) < 1e-4


@pytest.mark.sampled("each delay and each set of gains once")
@pytest.mark.parametrize("delay", [0.004, 0.02, 0.06])
@pytest.mark.parametrize("lead", [0.0, 0.03])
@pytest.mark.parametrize("gains", [(6.5, 275.0, 1.0), (20.0, 30.0, 0.2), (0.5, 1.0, 0.0)])
def test_margins_are_those_of_python_control(rig, delay, gains, lead):
    """Found on the exact response, against splines through a fine grid; stable loops and others."""
    controller = Controller(rig, ControlSettings())
    case = controller.design.cases(controller.channels[0].models, controller.settings)[0]
    timing = LoopTiming(0.002, delay, 0.005, 0.4, 0.01)
    pid = PidGains(*gains, 0.01, lead=lead)
    found = margins(case, timing, pid, is_stable(case, timing, pid))
    omega = np.geomspace(0.05, 500.0, 4000)
    opened = pid_response(pid, timing, omega) * frequency_response(
        case.point, case.loop, timing, omega
    )
    gain, phase, modulus, *_ = control.stability_margins(control.frd(opened, omega, smooth=True))
    assert found.gain_margin == pytest.approx(gain, rel=1e-3)
    assert math.degrees(found.phase_margin) == pytest.approx(phase, abs=0.05)
    assert found.modulus_margin == pytest.approx(modulus, rel=1e-3)


def test_unsafe_gains_are_refused_with_the_figures(rig):
    gains = GainSchedule.constant(PidGains(6.0, 280.0, 8.0, 0.01))
    settings = ControlSettings(gains={"elbow": gains})
    with pytest.raises(ControlDesignError, match=r"elbow.*UNSTABLE.*phase margin.*30 deg"):
        Controller(rig, settings)


def test_a_change_that_breaks_the_margins_leaves_the_settings_alone(rig):
    controller = Controller(rig, ControlSettings())
    before = controller.settings
    with pytest.raises(ControlDesignError):
        controller.change(ControlSettings(partial_gains={"elbow": {"integral": 5000.0}}))
    assert controller.settings is before
    controller.change(ControlSettings(partial_gains={"elbow": {"proportional": 5.0}}))
    assert all(each.proportional == 5.0 for each in controller.settings.gains["elbow"].gains)
    assert controller.channels[0].setup.margins[0].phase_margin > math.radians(30.0)


def test_more_delay_means_less_margin_for_the_same_gains(rig):
    controller = Controller(rig, ControlSettings())
    channel, settings = controller.channels[0], controller.settings
    case = controller.design.cases(channel.models, settings)[-1]
    gains = settings.gains["elbow"].at(case.scheduled)
    found = [
        margins(case, LoopTiming(0.002, delay, 0.005, 0.4, 0.01), gains, True)
        for delay in (0.004, 0.012, 0.02)
    ]
    assert found[0].phase_margin > found[1].phase_margin > found[2].phase_margin


def test_shut_chambers_of_the_linear_joint_swing_as_the_plant_does(rig):
    """Valves shut: the plant's ringing frequency is that of spring and trapped gas."""
    model = JointStatics.from_rig(rig, "elbow")
    point = operating_point(compose(rig).joints[0], model, 0.0, (2.5e5, 2.5e5))
    gas = -sum(n * -c for n, c in zip(point.torque_slopes, point.motion_pressure, strict=True))
    expected = math.sqrt((point.spring + gas) / point.inertia) / (2.0 * math.pi)
    parameters = PlantParameters.from_rig(rig)
    state = initial_state(parameters, pressures=(2.5e5, 2.5e5), position=0.01)
    ringing = simulate(parameters, np.zeros((4000, 2)), 1e-3, state).position
    ringing = ringing - ringing[-200:].mean()  # gas trapped off the centre: it rests off it
    ringing = ringing[:1200]
    rising = np.nonzero((ringing[:-1] < 0.0) & (ringing[1:] >= 0.0))[0]
    found = (len(rising) - 1) / (1e-3 * (rising[-1] - rising[0]))
    assert found == pytest.approx(expected, rel=0.02)


def test_inverse_dynamics_gives_the_torque_that_moves_the_plant_so(rig):
    parameters = PlantParameters.from_rig(rig)
    state = initial_state(parameters, pressures=(2.6e5, 2e5), position=0.1)
    moved = simulate(parameters, np.tile([0.05, -0.08], (300, 1)), 1e-3, state)
    q, qd = moved.position, moved.velocity
    qdd = np.gradient(qd, 1e-3)
    dynamics = InverseDynamics.from_joint(compose(rig).joints[0])
    for row in range(20, 280, 20):
        torque = dynamics.torque(float(q[row]), float(qd[row]), float(qdd[row]))
        assert torque == pytest.approx(float(moved.torque[row]), abs=0.02)


def test_a_clipped_pid_settles_where_its_output_just_saturates():
    pid = feedback(PidGains(2.0, 20.0, 0.0, 0.01))
    for _ in range(5000):
        output = pid_output(*pid, 1.0, 0.002)
        missed = max(-3.0, min(3.0, output)) - output
        integrate(*pid, 1.0, 0.002, missed, 1e9, False)
    assert output < 6.0  # 5 s of error would have made it 200
    for _ in range(200):
        output = pid_output(*pid, -0.2, 0.002)
        integrate(*pid, -0.2, 0.002, 0.0, 1e9, False)
    assert output < 3.0


def test_a_repeated_sample_does_not_look_like_standing_still():
    pid = feedback(PidGains(0.0, 0.0, 1.0, 0.02))
    for sample in range(200):
        pid_output(*pid, 0.01 * sample, 0.01)
        again = pid_output(*pid, 0.01 * sample, 0.0)
    assert again == pytest.approx(1.0, rel=1e-3)


def test_a_slow_regulator_does_not_slow_the_pressure_loop_of_another_joints_flow_valves() -> None:
    both = load_rig(TWO_JOINTS)
    alone = replace(both, joints=both.joints[:1], muscles=both.muscles[:2])
    gains = [Controller(rig, ControlSettings()).settings.pressure_gain for rig in (both, alone)]
    assert gains[0] == gains[1]


def test_a_joint_with_two_kinds_of_valve_is_refused() -> None:
    rig = load_rig(TWO_JOINTS)
    flow, regulator = rig.muscle("shoulder_flexor"), rig.muscle("elbow_flexor")
    mixed = rig.with_muscle(replace(flow, valve=regulator.valve))
    with pytest.raises(
        RigError, match="shoulder: its muscles have a pressure_regulator and a flow"
    ):
        Controller(mixed, ControlSettings())


@pytest.mark.parametrize("law", laws())
def test_a_rig_with_a_muscle_that_cannot_pull_is_refused_by_every_law(rig, law):
    slack = rig.with_muscle(replace(rig.muscles[0], neutral_length=0.18))
    with pytest.raises(RigError, match=r"^elbow_flexor\.neutral_length = 0\.18 m: at some angles"):
        Controller(slack, ControlSettings(), law=laws()[law]())
