"""What the rig file names is compensated: the same afflicted plant is tracked better with it."""

import dataclasses
import math

import numpy as np
import pytest

from pam_control.compensation.bladder_creep import BladderCreep
from pam_control.compensation.dry_friction import SMOOTHING_SPEED, DryFriction
from pam_control.compensation.history_torque import HistoryTorque
from pam_control.compensation.inverse_dynamics import InverseDynamics
from pam_control.compensation.thread_hysteresis import ThreadHysteresis
from pam_control.compensation.valve_inverse import ROUNDED, ValveInverse
from pam_control.control_step import Measurement
from pam_control.feedback.margins import margins
from pam_control.joint_channel import JointChannel, Plan
from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.references.trajectory import JointReference
from pam_control.settings import ControlSettings
from pam_model.effects import EFFECTS
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import Joint

SETTLE = 2.0

COMPENSATED = {
    "valve_dead_zone": {"overlap": 0.08},
    "valve_null_offset": {"offset": 0.06},
    "valve_lag": {"extra_time_constant": 0.02},
    "exhaust_restriction": {"ratio": 0.6},
    "command_delay": {"delay": 0.015},
    "dead_volume": {"extra_volume": 1e-4},
    "hysteresis": {"amplitude": 0.08},
    "creep": {"ratio": 0.3, "time_constant": 3.0},
    "bladder_elasticity": {"linear": 1500.0},
    "end_caps": {"factor": 1.15},
    "braid_extensibility": {"compliance": 3e-7},
    "cable_compliance": {"compliance": 2e-5},
    "coulomb_friction": {"torque": 0.5},
    "stribeck_friction": {"static_torque": 0.6, "torque": 0.4, "speed": 0.1},
    "viscous_friction": {"extra": 0.4},
    "payload": {"mass": 0.8},
    "pulley_radius": {"scale": 1.12},
    "position_offset": {"offset": 0.05},
    "position_delay": {"delay": 0.02},
    "pressure_gain": {"gain": 0.7},
    "pressure_bias": {"bias": 6e4},
}


ONE_SIDED = ("valve_null_offset", "pressure_gain", "pressure_bias")
"""Effects that hurt the position when the two muscles differ in them."""


def told(rig, effect, values):
    """The rig with the effect on its joint, or on its muscles, or on its agonist alone."""
    given = {effect: values}
    if EFFECTS[effect].scope == "joint":
        return rig.with_joint(dataclasses.replace(rig.joints[0], effects=given))
    muscles = rig.joints[0].muscles
    for name in muscles[:1] if effect in ONE_SIDED else muscles:
        rig = rig.with_muscle(dataclasses.replace(rig.muscle(name), effects=given))
    return rig


def run(loop_type, controller, motion, effects, **options):
    points, duration = motion
    loop = loop_type(controller, effects=effects, **options)
    loop.run(SETTLE)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    return loop.run(duration + 0.2)


@pytest.fixture(scope="module")
def nominal(rig):
    return PositionStiffnessController(rig, ControlSettings())


@pytest.mark.parametrize("effect", COMPENSATED)
def test_the_same_plant_is_tracked_better_with_the_effect_in_the_rig_file(
    rig, nominal, closed_loop, reaching, effect
):
    values = COMPENSATED[effect]
    side = "agonist." if effect in ONE_SIDED else ""
    hidden = {f"{side}{effect}.{key}": value for key, value in values.items()}
    nominal.deactivate()
    before = run(closed_loop, nominal, reaching, hidden).rms(SETTLE)
    knowing = PositionStiffnessController(told(rig, effect, values), ControlSettings())
    after = run(closed_loop, knowing, reaching, hidden).rms(SETTLE)
    assert after < before


def test_leaks_are_filled_up(rig, nominal, closed_loop):
    """A leak costs pressure, and so stiffness, long before it costs the position."""
    hidden = {"leakage.conductance": 1e-9}
    named = rig
    for name in rig.joints[0].muscles:
        named = named.with_muscle(
            dataclasses.replace(rig.muscle(name), effects={"leakage": {"conductance": 1e-9}})
        )
    missing = []
    nominal.deactivate()
    for controller in (nominal, PositionStiffnessController(named, ControlSettings())):
        loop = closed_loop(controller, effects=hidden, pressure_noise=0.0, quantum=0.0)
        last = loop.run(SETTLE).rows[-1]
        missing.append(abs(controller.channels[0].desired[0] - last[3]))
    assert missing[0] > 1e3
    assert missing[1] < 0.1 * missing[0]


def test_neutral_effects_change_nothing_bit_for_bit(rig, closed_loop, reaching):
    effects = {
        name: {key: entry.neutral for key, entry in effect.parameters.items()}
        for name, effect in EFFECTS.items()
    }
    of = {
        scope: {name: effects[name] for name, effect in EFFECTS.items() if effect.scope == scope}
        for scope in ("joint", "muscle")
    }
    neutral = rig.with_joint(dataclasses.replace(rig.joints[0], effects=of["joint"]))
    for name in rig.joints[0].muscles:
        neutral = neutral.with_muscle(
            dataclasses.replace(neutral.muscle(name), effects=of["muscle"])
        )
    fresh = PositionStiffnessController(rig, ControlSettings())
    named = PositionStiffnessController(neutral, ControlSettings())
    assert named.settings == fresh.settings
    first, second = (run(closed_loop, law, reaching, {}) for law in (fresh, named))
    assert first.rows == second.rows


def test_unequal_delays_of_the_valves_are_each_looked_ahead_for(rig, nominal, closed_loop, chirp):
    hidden = {
        "agonist.command_delay.delay": 0.012,
        "antagonist.valve_lag.extra_time_constant": 0.01,
    }
    agonist, antagonist = (rig.muscle(name) for name in rig.joints[0].muscles)
    knowing = rig.with_muscle(
        dataclasses.replace(agonist, effects={"command_delay": {"delay": 0.012}})
    ).with_muscle(
        dataclasses.replace(antagonist, effects={"valve_lag": {"extra_time_constant": 0.01}})
    )
    nominal.deactivate()
    before = run(closed_loop, nominal, chirp, hidden).rms(SETTLE)
    after = run(
        closed_loop, PositionStiffnessController(knowing, ControlSettings()), chirp, hidden
    ).rms(SETTLE)
    assert after < 0.5 * before


def with_delay(rig, side, delay):
    """The rig with this command delay [s] on one muscle of its joint."""
    muscle = rig.muscle(rig.joints[0].muscles[side])
    told_delay = {"command_delay": {"delay": delay}}
    return rig.with_muscle(dataclasses.replace(muscle, effects=told_delay))


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("difference", [1e-9, 1e-6, 1e-3])
def test_a_small_difference_of_the_valves_delays_keeps_the_feedforward_of_both(
    rig, closed_loop, chirp, difference, side
):
    """The muscle that acts earlier must not lose the rate of its planned pressure."""
    delays = {"agonist.command_delay.delay": difference * (side == 0)}
    delays["antagonist.command_delay.delay"] = difference * (side == 1)
    quiet = {"pressure_noise": 0.0, "quantum": 0.0}
    equal = PositionStiffnessController(rig, ControlSettings())
    apart = PositionStiffnessController(with_delay(rig, side, difference), equal.settings)
    errors = [run(closed_loop, law, chirp, delays, **quiet).rms(SETTLE) for law in (equal, apart)]
    assert errors[1] < 1.2 * errors[0]


@pytest.mark.parametrize("period", [0.0005, 0.002, 0.02])
def test_plans_reach_back_over_every_delay_at_every_rate(rig, period):
    """Remembered by time: 0.4 s of delay is 20 plans at 50 Hz and 800 plans at 2 kHz."""
    channel = JointChannel(rig, rig.joints[0], 5e3)
    delay, slope = 0.4, (3e4, -2e4)
    for cycle in range(round(1.0 / period) + 1):
        time = cycle * period
        plan = Plan(time, (slope[0] * time, slope[1] * time), 10.0 * time, 0.1 * time)
        channel.remember(plan, time - delay)
    then = channel.plan_at(time - delay)
    assert then.pressures == pytest.approx((slope[0] * 0.6, slope[1] * 0.6))
    assert (then.stiffness, then.memory_torque) == pytest.approx((6.0, 0.06))
    for lead in (0.0, 1e-6, 0.3 * period, 3.7 * period):
        assert channel.planned_rates((time, time - lead)) == pytest.approx(slope)
        assert channel.planned_rates((time - lead, time)) == pytest.approx(slope)
    assert len(channel.plans) < 0.6 / period


def worst(cases, timing, gains):
    """Whether all loops are stable, and their least modulus margin."""
    found = [margins(case, timing, gains) for case in cases]
    return all(each.stable for each in found), min(each.modulus_margin for each in found)


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("payload", {"mass": 1.5}),
        ("command_delay", {"delay": 0.02}),
        ("position_delay", {"delay": 0.02}),
        ("valve_lag", {"extra_time_constant": 0.05}),
    ],
)
def test_gain_design_sees_what_changes_the_loop(rig, nominal, effect, values):
    """The gains of the nominal rig leave less margin on the rig with the effect."""
    knowing = PositionStiffnessController(told(rig, effect, values), ControlSettings())
    channel, settings = knowing.channels[0], knowing.settings
    cases = knowing.cases(channel, nominal.settings)
    timing = knowing.timing(channel, nominal.settings)
    gains = nominal.settings.gains["elbow"]
    kept = worst(cases, timing, gains)
    designed = worst(knowing.cases(channel, settings), timing, settings.gains["elbow"])
    assert settings.gains["elbow"] != gains
    assert designed > kept
    assert designed[0]
    assert designed[1] >= 0.98 / settings.sensitivity


def test_payload_is_a_point_mass():
    effects = {"payload": {"mass": 2.0}}
    joint = Joint("j", ("a", "b"), 0.03, 0.04, (-1.0, 1.0), effects=effects)
    dynamics = InverseDynamics.from_joint(joint)
    assert dynamics.inertia == pytest.approx(0.04 + 2.0 * 0.3**2)
    assert dynamics.gravity_torque - joint.gravity_torque == pytest.approx(2.0 * 9.80665 * 0.3)


def test_dry_friction_is_odd_and_saturates():
    friction = DryFriction(0.3, 0.6, 0.4, 0.1)
    for speed in (1e-3, 0.02, 0.1, 2.0):
        assert friction.torque(-speed) == -friction.torque(speed)
        assert 0.0 < friction.torque(speed) <= 0.9
    assert friction.torque(0.0) == 0.0
    assert friction.torque(30.0 * SMOOTHING_SPEED) == pytest.approx(0.7, rel=1e-3)


def test_thread_friction_does_not_know_time_nor_steps():
    """Rate-independent: a stroke in one piece or in many ends in the same state."""
    whole, parts = ThreadHysteresis(1e-4, 1e-3), ThreadHysteresis(1e-4, 1e-3)
    for stroke in (2e-3, -7e-4, 3e-4):
        whole.move(stroke)
        for _ in range(50):
            parts.move(stroke / 50)
        assert parts.state == pytest.approx(whole.state, abs=1e-12)
        assert abs(whole.state) < 1.0


def test_creep_relaxes_with_its_time_constant():
    creep = BladderCreep(1000.0, 2.0)
    creep.move(0.01, 0.0)
    assert creep.force == pytest.approx(10.0)
    creep.move(0.0, 2.0)
    assert creep.force == pytest.approx(10.0 * math.exp(-1.0))


def test_history_is_that_of_the_simulated_muscle(rig):
    """Pushed through the same lengths, controller and plant agree on the torque."""
    effects = {"hysteresis": {"amplitude": 0.1}, "creep": {"ratio": 0.3, "time_constant": 1.0}}
    named = rig
    for name in rig.joints[0].muscles:
        named = named.with_muscle(dataclasses.replace(rig.muscle(name), effects=effects))
    time = np.arange(0.0, 4.0, 0.002)
    q = 0.4 * np.sin(1.5 * time) * np.minimum(time, 1.0)
    p = np.full((len(time), 2), 2.5e5)
    torques = []
    for each in (rig, named):
        parameters = PlantParameters.from_rig(each, 0)
        start = initial_state(parameters, pressures=(2.5e5, 2.5e5))
        result = simulate(
            parameters, np.zeros((len(time), 2)), 0.002, start, positions=q, pressures=p
        )
        torques.append(rig.joints[0].pulley_radius * (result.forces[:, 0] - result.forces[:, 1]))
    history = HistoryTorque(
        tuple(named.muscle(name) for name in rig.joints[0].muscles), rig.joints[0].pulley_radius
    )
    own = [history.advance(t, x, (2.5e5, 2.5e5)) for t, x in zip(time, q, strict=True)]
    difference = np.array(own) - (torques[1] - torques[0])
    assert np.abs(torques[1] - torques[0]).max() > 0.2
    assert np.abs(difference).max() < 0.02 * np.abs(torques[1] - torques[0]).max()


@pytest.mark.parametrize("overlap", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("null", [-0.1, 0.0, 0.07])
def test_spool_undoes_overlap_and_null_offset(overlap, null):
    inverse = ValveInverse(0.5, overlap, null)
    for opening in (-0.8, -0.2, -ROUNDED, ROUNDED, 0.3, 0.9):
        spool = inverse.spool(opening) + null
        passed = math.copysign(max(0.0, abs(spool) - overlap) / (1.0 - overlap), spool)
        assert passed == pytest.approx(opening, abs=1e-12)
    assert inverse.spool(0.0) == -null
    assert inverse.opening(-0.2) == pytest.approx(-0.4)
    assert inverse.opening(0.2) == 0.2


def test_sensor_errors_are_taken_out_of_what_is_reported(rig):
    offset = told(rig, "position_offset", {"offset": 0.1})
    controller = PositionStiffnessController(offset, ControlSettings())
    controller.step(0.0, Measurement([0.25], [1e5, 1e5], 0.0, 0.0))
    assert controller.channels[0].telemetry.reference == JointReference(pytest.approx(0.15))
    assert controller.channels[0].telemetry.error == pytest.approx(0.0, abs=1e-12)
