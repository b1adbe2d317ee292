"""What the controller learns of a rig that is not its rig file, and when it learns nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pam_control.adaptation.flow_adaptation import (
    EVERY,
    FlowAdaptation,
    corrected_flow,
    take_flow,
    unit_loss,
)
from pam_control.adaptation.motion_functions import begin_memory, element, move_memory
from pam_control.adaptation.normal_equations import CORRELATED
from pam_control.adaptation.recursive_fit import RecursiveFit, Suspect
from pam_control.adaptation.tube_pressure import pressure_behind_tube
from pam_control.controller import Controller
from pam_control.cycle.pressure_loops import PressureLoops
from pam_control.cycle.valve_stage import command_valves, true_pressures
from pam_control.feedback.stuck_integral import begin_sticking, given_back
from pam_control.joint_models import JointModels
from pam_control.loop_guard import GuardAction, LoopGuard
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.rows.loop_rows import (
    D_RATE,
    D_REFERENCE,
    D_SPEED,
    N_FULL,
    N_NUMBERS,
    N_STATE,
    V_INSIDE,
    V_SINCE,
)
from pam_control.rows.muscle_table import MuscleTable
from pam_control.rows.plan_rows import N_MEMORY, N_PLAN, Y_ADAPTED
from pam_control.settings import ControlSettings
from pam_model.plant.compiled import for_kernel
from pam_model.robot import compose
from pam_model.views.joint_numbers import joint_numbers

SETTLE = 1.0
PAYLOAD = {"payload.mass": 0.5, "payload.distance": 0.2}
STEP = 0.002
SUPPLY = 7e5  # Pa absolute
VISCOUS = 3  # index of the weight of the speed


def law(rig, **settings):
    asked = ControlSettings(**{"adaptation": True, **settings})
    return Controller(rig, asked)


def played(closed_loop, controller, motion, **options):
    """RMS error [rad] of a motion, beginning with what the controller has learnt before."""
    points, duration = motion
    loop = closed_loop(controller, **options)
    controller.drop_commands()
    loop.run(SETTLE)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    return loop.run(duration).rms(SETTLE)


def test_a_hidden_payload_is_learnt_in_one_motion(closed_loop, rig, reaching):
    without = played(closed_loop, law(rig, adaptation=False), reaching, effects=PAYLOAD)
    learning = law(rig)
    first = played(closed_loop, learning, reaching, effects=PAYLOAD)
    second = played(closed_loop, learning, reaching, effects=PAYLOAD)
    assert first < 0.6 * without
    assert second < 0.35 * without


def test_nothing_is_learnt_of_a_rig_that_is_its_rig_file(closed_loop, rig, reaching):
    controller = law(rig)
    played(closed_loop, controller, reaching)
    channel = controller.channels[0]
    assert not channel.law_state.estimates.adaptation.knows
    assert not any(weight for loop in channel.loops for weight in loop.adaptation.weights)


def test_a_learnt_payload_is_reported_and_does_not_move_the_joint_when_it_is_forgotten(
    closed_loop, rig, reaching
):
    controller = law(rig)
    played(closed_loop, controller, reaching, effects=PAYLOAD)
    loop = closed_loop(controller, effects=PAYLOAD)
    controller.drop_commands()
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [0.6], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(3.0)
    torque = -0.5 * 9.81 * 0.2 * math.sin(0.6)
    assert controller.channels[0].telemetry.disturbance == pytest.approx(torque, rel=0.3)
    before = loop.run(0.2).column(2).mean()
    controller.change(controller.settings.replace(adaptation=False))
    assert not controller.channels[0].law_state.estimates.adaptation.knows
    assert np.abs(loop.run(1.0).column(2) - before).max() < 0.02


def test_taking_over_with_what_was_learnt_does_not_move_the_joint(closed_loop, rig, reaching):
    controller = law(rig)
    played(closed_loop, controller, reaching, effects=PAYLOAD)
    loop = closed_loop(controller, effects=PAYLOAD)
    controller.drop_commands()
    loop.run(SETTLE)
    points = [TrajectoryPoint(1.0, [0.6], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(3.0)
    before = loop.run(0.2).column(2).mean()
    controller.deactivate()
    assert np.abs(loop.run(1.0).column(2) - before).max() < 0.02


class Softening(LoopGuard):
    """Finds an oscillation in the first cycle, and nothing after it."""

    def judge(self, *_, **__):
        if self.softened:
            return GuardAction.NOTHING
        self.softened = "the joint oscillates"
        return GuardAction.SOFTEN


def test_soft_gains_forget_what_an_oscillation_has_taught_and_learn_again(
    closed_loop, rig, reaching
):
    """Without what is learnt they leave large errors, for as long as they are used."""
    controller, (points, duration) = law(rig), reaching
    played(closed_loop, controller, reaching, effects=PAYLOAD)
    estimates = controller.channels[0].law_state.estimates
    assert estimates.adaptation.knows
    loop = closed_loop(controller, effects=PAYLOAD)
    controller.drop_commands()
    loop.run(SETTLE)
    controller.guard = Softening(controller.robot.joints)
    loop.run(0.01)
    assert controller.guard.softened
    assert not estimates.adaptation.knows
    errors = []
    for _ in range(2):
        controller.references.follow(["elbow"], points, start=None, now=loop.time)
        errors.append(loop.run(duration).rms(0.0))
    controller.change(controller.prepared.asked.replace(integral_limit=4.0))
    assert estimates.adaptation.knows, "another parameter forgets nothing"
    assert errors[1] < 0.5 * errors[0]


def test_the_learnt_torque_is_limited(closed_loop, rig, reaching):
    controller = law(rig, adaptation_limit=0.1)
    points, duration = reaching
    loop = closed_loop(controller, effects=PAYLOAD)
    loop.run(SETTLE)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    used = []
    loop.run(duration, lambda _: used.append(controller.channels[0].law_state.y[Y_ADAPTED]))
    assert max(map(abs, used)) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("effect", "delay", "found"),
    [
        ({"position_delay.delay": 0.018}, 0.018, "late_position"),
        ({"pressure_lag.time_constant": 0.02}, 0.02, "late_pressures"),
    ],
    ids=str,
)
def test_a_delay_of_a_sensor_is_told_from_friction(
    closed_loop, rig, reaching, effect, delay, found
):
    controller = law(rig)
    played(closed_loop, controller, reaching, effects=effect)
    channel = controller.channels[0]
    assert getattr(channel, found) == pytest.approx(delay, abs=3e-3)
    assert max(channel.late_commands) == 0.0
    assert abs(channel.law_state.estimates.adaptation.weights[VISCOUS]) < 0.1  # N m s/rad


def test_viscous_friction_is_not_taken_for_a_delay(closed_loop, rig, reaching):
    controller = law(rig)
    played(closed_loop, controller, reaching, effects={"viscous_friction.extra": 0.35})
    channel = controller.channels[0]
    assert channel.law_state.estimates.adaptation.delay == 0.0
    assert channel.law_state.estimates.adaptation.weights[VISCOUS] == pytest.approx(0.35, abs=0.07)


@pytest.mark.long("a delay of a sensor is learnt in the tests above")
def test_the_true_angle_of_a_late_encoder_follows_once_the_delay_is_learnt(
    closed_loop, rig, reaching
):
    late = {"position_delay.delay": 0.018}
    without = played(closed_loop, law(rig, adaptation=False), reaching, effects=late)
    learning = law(rig)
    played(closed_loop, learning, reaching, effects=late)
    assert played(closed_loop, learning, reaching, effects=late) < 0.3 * without


@pytest.mark.long("a delay of a sensor is learnt in the tests above")
def test_the_feedforward_looks_ahead_by_a_delay_of_the_commands_that_was_learnt(
    closed_loop, rig, chirp
):
    late = {"command_delay.delay": 0.015}
    without = played(closed_loop, law(rig, adaptation=False), chirp, effects=late)
    learning = law(rig)
    played(closed_loop, learning, chirp, effects=late)
    assert all(0.006 < late < 0.018 for late in learning.channels[0].late_commands)
    assert played(closed_loop, learning, chirp, effects=late) < 0.5 * without


# --- the parts ---------------------------------------------------------------------------------


def test_a_fit_ignores_noise_and_finds_what_is_there():
    random, wanted = np.random.default_rng(3), np.array([0.5, -0.2])
    silent, finding = (RecursiveFit((1.0, 1.0), 0.05, 0.02) for _ in range(2))
    for _ in range(500):
        functions = random.standard_normal(2)
        noise = 0.05 * random.standard_normal()
        silent.update(functions, noise, 0.01)
        finding.update(functions, float(functions @ wanted) + noise, 0.01)
    assert silent.weights == [0.0, 0.0]
    assert finding.weights == pytest.approx(wanted, abs=0.02)


def test_a_fit_that_has_seen_one_direction_only_does_not_guess_the_other():
    fit = RecursiveFit((1.0, 1.0), 0.05, 0.01)
    for _ in range(500):
        fit.update(np.array([1.0, 1.0]), 0.6, 0.01)
    assert fit.weights == pytest.approx([0.3, 0.3], abs=0.01)


def test_before_anything_was_seen_a_weight_is_as_uncertain_as_was_said():
    """The inverse for the interval was singular, which ended the node that was asked for it."""
    fit = RecursiveFit((0.2, 3.0), 0.05, 0.01)
    assert [fit.deviation(0), fit.deviation(1)] == pytest.approx([0.2, 3.0])


def test_the_interval_of_a_weight_is_that_of_ordinary_least_squares():
    random, fit = np.random.default_rng(7), RecursiveFit((10.0, 10.0), 0.05, 0.01)
    seen = random.standard_normal((40, 2)) * (1.0, 0.1)
    for functions in seen:
        fit.update(functions, float(functions @ (0.5, -2.0)), CORRELATED)
    expected = 0.05 * np.sqrt(np.diag(np.linalg.inv(seen.T @ seen)))
    assert [fit.deviation(0), fit.deviation(1)] == pytest.approx(expected, rel=0.15)


def test_a_suspect_is_used_only_where_nothing_else_can_be_the_cause():
    """It resembles the other function: one signal hardly tells them apart, the other does."""
    random, last = np.random.default_rng(6), {}
    for apart in (0.03, 1.0):
        fit = RecursiveFit((1.0, 1.0), 0.05, 0.01, Suspect(least=0.1, better=2.0))
        for _ in range(2000):
            first, other = random.standard_normal(2)
            functions = np.array([first, first + apart * other])
            fit.update(functions, float(0.5 * functions[1]) + 0.05 * random.standard_normal(), 0.01)
        last[apart] = fit.weights
    assert last[0.03] == pytest.approx([0.5, 0.0], abs=0.02)
    assert last[1.0] == pytest.approx([0.0, 0.5], abs=0.02)


def sticking():
    """State of a plan in which no integral was gathered."""
    state = [0.0] * N_PLAN
    begin_sticking(state)
    return state


@pytest.mark.parametrize(("friction", "back"), [(0.5, 0.2), (0.05, 0.05), (0.0, 0.0)])
def test_what_the_integral_gathers_while_a_joint_sticks_is_given_back(friction, back):
    stuck, integral = sticking(), 0.1
    for _ in range(100):  # at rest, 3 mrad beside the target
        integral += 0.002
        assert given_back(stuck, (0.3, 0.0, 0.0), 0, 0.297, integral, friction) == 0.0
    taken = 0.0
    for cycle in range(100):
        reference = (0.3 + 3e-4 * cycle, 0.15, 0.0)
        taken += given_back(stuck, reference, 0, 0.297, integral - taken, friction)
    assert taken == pytest.approx(back, rel=0.03)


def test_an_encoder_that_flickers_by_a_count_does_not_hide_that_a_joint_sticks():
    stuck, integral, count = sticking(), 0.1, math.tau / 4096
    for cycle in range(100):
        integral += 0.002
        given_back(stuck, (0.3, 0.0, 0.0), 0, 0.297 + count * (cycle % 2), integral, 0.5)
    taken = sum(
        given_back(stuck, (0.3 + 3e-4 * k, 0.15, 0.0), 0, 0.297, 0.0, 0.5) for k in range(100)
    )
    assert taken == pytest.approx(0.2, rel=0.03)


def test_a_joint_that_moves_while_its_reference_rests_does_not_stick():
    stuck, integral = sticking(), 0.0
    for cycle in range(100):  # pushed back by a load that was put on
        integral += 0.002
        given_back(stuck, (0.3, 0.0, 0.0), 0, 0.25 + 5e-4 * cycle, integral, 0.5)
    taken = sum(
        given_back(stuck, (0.3 + 3e-4 * k, 0.15, 0.0), 0, 0.3, integral, 0.5) for k in range(100)
    )
    assert taken < 0.01


def test_a_fit_follows_what_has_changed():
    random, fit = np.random.default_rng(4), RecursiveFit((1.0,), 0.05, 0.01)
    for load in (0.5, 0.1):
        for _ in range(6000):  # a minute
            value = random.standard_normal()
            fit.update(np.array([value]), load * value, 0.01)
        assert fit.weights == pytest.approx([load], abs=0.02)


@pytest.mark.parametrize("hidden", [0.0, 0.5])
def test_a_suspect_is_either_fitted_like_the_others_or_changes_nothing(hidden):
    random, deviations = np.random.default_rng(5), (1.0, 2.0, 1.0)
    count = 3 if hidden else 2
    plain = RecursiveFit(deviations[:count], 0.05, 0.01)
    watched = RecursiveFit(deviations, 0.05, 0.01, Suspect(least=1e-3, better=2.0))
    for _ in range(500):
        functions = random.normal(size=3)
        value = functions @ (0.4, -0.3, hidden) + 0.05 * random.normal()
        plain.update(functions[:count], value, 0.01)
        watched.update(functions, value, 0.01)
    # before the suspect is used, less is expected, and a little more is forgotten
    assert watched.weights == pytest.approx([*plain.weights, 0.0][:3], rel=1e-9 + 1e-5 * hidden)


def test_slip_elements_make_a_loop_that_closes():
    memory, there, back = [0.0] * N_MEMORY, [], []
    begin_memory(memory, 0)

    def slips(position):
        move_memory(memory, 0, position, STEP)
        return [element(memory, 0, number) for number in range(4)]

    sweep = np.linspace(-0.5, 0.5, 400)
    for _ in range(2):
        there = [slips(q) for q in sweep]
        back = [slips(q) for q in sweep[::-1]]
    assert np.all(np.array(there[200]) > 0.8)
    assert np.all(np.array(back[200]) < -0.8)


class Valve:
    """What is learnt of one valve, with the rows of its loop."""

    def __init__(self, full: float) -> None:
        self.numbers, self.state = (for_kernel(np.zeros(n)) for n in (N_NUMBERS, N_STATE))
        self.numbers[N_FULL] = full
        self.adaptation = FlowAdaptation(self.numbers, self.state, SUPPLY)

    def learn(self, promised, pressure, per_rate, lost=0.0, delay=0.0):
        full = self.numbers[N_FULL]
        take_flow(
            self.numbers, self.state, STEP, promised, full, pressure, lost, per_rate, 0.0, delay
        )
        if self.state[V_SINCE] >= EVERY:
            self.adaptation.update()

    def asked(self, wanted, pressure):
        full = self.numbers[N_FULL]
        return corrected_flow(self.numbers, self.state, wanted, 0.0, full, pressure)


def test_a_supply_that_falls_while_air_is_taken_is_told_from_a_narrow_path():
    """Its share of the flow is asked for in addition while it lacks, and not after a rest."""
    full, per_rate = 3e-3, 2e-9
    valve = Valve(full)
    pressure, taken = 2e5, 0.0
    for cycle in range(10000):
        now = STEP * cycle
        busy = 1.0 if now % 8.0 < 4.0 else 0.1
        promised = busy * full * (0.3 * math.sin(9.0 * now) + 0.2 * math.sin(23.0 * now))
        up = max(promised, 0.0)
        taken += STEP / 10.0 * (up / full - taken)
        pressure += STEP * (promised - 4.0 * up * taken) / per_rate
        valve.learn(promised, pressure, per_rate)
    wanted = 0.3 * full
    asked = valve.asked(wanted, pressure)
    assert asked * (1.0 - 4.0 * taken) == pytest.approx(wanted, rel=0.03)
    assert asked > 1.1 * wanted


def _true_flow(promised, exhaust, offset, overlap, leak, pressure, capacity):
    opening = promised / capacity + offset
    opening = math.copysign(max(abs(opening) - overlap, 0.0), opening)
    path = exhaust if opening < 0.0 else 1.0
    return (path * opening - leak * pressure / SUPPLY) * capacity


@pytest.mark.parametrize(
    ("exhaust", "offset", "overlap", "leak"),
    [(0.6, 0.0, 0.0, 0.0), (1.0, 0.03, 0.0, 0.0), (1.0, 0.0, 0.05, 0.0), (1.0, 0.0, 0.0, 0.04)],
)
def test_a_valve_gives_what_is_asked_for_after_its_flow_was_learnt(exhaust, offset, overlap, leak):
    full, per_rate, delay = 3e-3, 2e-9, 0.005
    valve = Valve(full)
    random, pressure, late = np.random.default_rng(5), 2e5, 0.0
    for cycle in range(4000):
        now = STEP * cycle
        promised = full * (0.3 * math.sin(5.0 * now) + 0.15 * math.sin(13.0 * now))
        late += STEP / (delay + STEP) * (promised - late)
        given = _true_flow(late, exhaust, offset, overlap, leak, pressure, full)
        pressure += STEP * given / per_rate
        shown = pressure + 70.0 * random.standard_normal()
        valve.learn(promised, shown, per_rate, delay=delay)
    for wanted in (-0.3 * full, 0.3 * full):
        asked = valve.asked(wanted, pressure)
        given = _true_flow(asked, exhaust, offset, overlap, leak, pressure, full)
        assert given == pytest.approx(wanted, rel=0.06)


@pytest.mark.parametrize(
    ("tube", "volume", "late"),
    [(1.8, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.3, 0.0), (0.0, 1.0, 0.02), (1.8, 1.3, 0.0)],
)
def test_a_tube_is_found_and_told_from_a_late_sensor_and_another_volume(tube, volume, late):
    """The sensor shows the pressure in the muscle and the loss in the tube, `late` seconds late."""
    full, per_rate = 3e-3, 2e-9
    valve = Valve(full)
    random, pressure, lagging, loss = np.random.default_rng(6), 3e5, 3e5, 0.0
    for cycle in range(4000):
        now = STEP * cycle
        flow = full * (0.15 * math.sin(5.0 * now) + 0.1 * math.sin(13.0 * now))
        pressure += STEP * flow / (volume * per_rate)
        loss = tube * flow * abs(flow) / full**2 * SUPPLY**2 / (2.0 * pressure)
        lagging += STEP / (late + STEP) * (pressure + loss - lagging)
        shown = lagging + 100.0 * random.standard_normal()
        found = valve.adaptation.tube.share * unit_loss(valve.numbers, flow, shown)
        valve.learn(flow, shown, per_rate, lost=found)
    found = valve.adaptation.tube.share
    assert found == pytest.approx(tube, rel=0.1)
    for _ in range(30000):  # a minute of rest
        valve.learn(0.0, pressure, per_rate)
    assert valve.adaptation.tube.share == pytest.approx(found, rel=0.02)


def test_the_pressure_behind_a_tube_is_that_of_the_flow_at_once_and_of_the_sensor_in_time():
    """So the loop does not chatter by what the sensor shows, and keeps no error of the flow."""
    state = [0.0] * N_STATE
    state[V_INSIDE] = math.nan
    assert pressure_behind_tube(state, STEP, 2e5, 0.0, 0.0) == 2e5
    at_once = pressure_behind_tube(state, STEP, 2.5e5, 2e4, 0.0)
    assert at_once < 2.02e5
    for _ in range(600):
        found = pressure_behind_tube(state, STEP, 2.5e5, 2e4, 0.0)
    assert found == pytest.approx(2.3e5, rel=1e-3)


@pytest.mark.parametrize("pressure", [0.0, 6e5])
def test_a_muscle_that_is_empty_or_at_the_supply_does_not_end_the_control_loop(rig, pressure):
    """The open valve has no flow there, of which a share could be learnt."""
    robot = compose(rig)
    joints = [JointModels.of(robot, robot.joints[0], 0.0)]
    table, constants = MuscleTable.of(robot), for_kernel(joint_numbers(robot))
    loops = PressureLoops(robot, joints, table, constants)
    rows, commands = (table.owners, constants, loops.numbers), [math.nan] * 2
    loops.use(0, ControlSettings(pressure_gain=15.0, lead_ratio=0.4), True, 0.005)
    rate = 1e5 if pressure else -1e5
    for cycle in range(50):
        wanted = pressure + math.copysign(1e4 * (cycle % 7), rate)
        true_pressures(*rows, loops.state, loops.demands, [pressure, pressure], STEP)
        for demand in loops.demands:
            demand[D_REFERENCE], demand[D_RATE], demand[D_SPEED] = wanted, rate, 0.3
        command_valves(
            *rows, loops.inverses, loops.settings, loops.state, loops.demands,
            robot.supply.pressure, 0.0, STEP, commands,
        )  # fmt: skip
        loops.learn()
        assert all(-1.0 <= command <= 1.0 for command in commands)
