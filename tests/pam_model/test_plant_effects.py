"""Each effect changes the plant as its physics predicts; at its neutral value it does nothing."""

from __future__ import annotations

import numpy as np
import pytest

from pam_model.effects import EFFECTS
from pam_model.plant.parameters import PlantParameters, neutral_values, parameter_names
from pam_model.plant.simulate import initial_state, simulate, simulate_measured

from .held_run import DT, HELD, simulate_held


@pytest.mark.parametrize("name", EFFECTS)
def test_neutral_is_nominal_to_the_bit(parameters, run, name):
    """Shape parameters have no influence while the magnitudes are neutral."""
    effect = EFFECTS[name]
    changes = {}
    for key, entry in effect.parameters.items():
        value = 0.37 * (entry.low + entry.high) if entry.is_shape else entry.neutral
        changes |= dict.fromkeys(parameter_names(name, key), value)
    np.testing.assert_array_equal(
        run(parameters.replaced(changes)).outputs, run(parameters).outputs
    )


# The value 0 switches these off; their physical limit is a wide path or a very good wall.
SWITCHED = {"supply_droop", "tube_restriction", "thermal"}


@pytest.mark.parametrize("name", [name for name in EFFECTS if name not in SWITCHED])
def test_every_effect_does_something_continuously(parameters, run, name):
    """Beyond neutral the readings change, and a tiny magnitude changes them little."""
    effect = EFFECTS[name]

    def readings(share):
        changes = {}
        for key in effect.magnitudes:
            entry = effect.parameters[key]
            span = min(entry.high - entry.neutral, 0.2 * SIZES.get(name, entry.high))
            changes |= dict.fromkeys(parameter_names(name, key), entry.neutral + share * span)
        changed = parameters.replaced(changes)
        return simulate_measured(changed, run(changed))

    nominal = simulate_measured(parameters, run(parameters))
    small, large = readings(1e-4), readings(1.0)

    def distance(measured):
        return max(
            np.max(np.abs(measured.position - nominal.position)),
            np.max(np.abs(measured.pressures - nominal.pressures)) / 1e5,
        )

    assert distance(large) > 2e-4
    assert 0.0 < distance(small) < 0.05 * distance(large)


SIZES = {  # realistic magnitudes; the bounds of the parameters are far wider
    "leakage": 1e-10,
    "dead_volume": 2e-4,
    "bladder_elasticity": 3e3,
    "coulomb_friction": 2.0,
    "stribeck_friction": 2.0,
    "viscous_friction": 5.0,
    "payload": 5.0,
    "braid_extensibility": 5e-7,
    "cable_compliance": 1e-4,
}


def test_dead_zone_shuts_small_commands(parameters):
    inside = np.tile([0.08, -0.08], (1000, 1))
    shut = simulate_held(parameters, {"valve_dead_zone.overlap": 0.1}, commands=inside)
    np.testing.assert_allclose(shut.pressures, 2e5, rtol=1e-9)
    full = np.tile([1.0, -1.0], (100, 1))
    a = simulate_held(
        parameters, {"valve_dead_zone.overlap": 0.1}, commands=full, positions=np.zeros(100)
    )
    b = simulate_held(parameters, {}, commands=full, positions=np.zeros(100))
    assert np.max(np.abs(a.pressures - b.pressures)) < 5e3


def test_null_offset_fills_one_muscle(parameters):
    result = simulate_held(parameters, {"agonist.valve_null_offset.offset": 0.02})
    assert result.position[-1] > 0.02
    closed = np.tile([-0.02, 0.0], (1000, 1))
    state = {"agonist.valve_null_offset.offset": 0.02}
    still = simulate_held(parameters, state, commands=closed)
    assert abs(still.position[-1]) < 2e-3


def test_lag_and_delay_come_later(parameters):
    step = np.tile([0.5, 0.0], (200, 1))
    fixed = np.zeros(200)
    nominal = simulate_held(parameters, {}, commands=step, positions=fixed)
    lag = simulate_held(
        parameters, {"valve_lag.extra_time_constant": 0.02}, commands=step, positions=fixed
    )
    assert np.all(lag.pressures[2:, 0] < nominal.pressures[2:, 0])
    moving = np.vstack([np.zeros((50, 2)), np.tile([0.5, 0.0], (150, 1))])
    on_time = simulate_held(parameters, {}, commands=moving, positions=fixed)
    late = simulate_held(
        parameters, {"command_delay.delay": 10 * DT}, commands=moving, positions=fixed
    )
    np.testing.assert_allclose(late.pressures[10:], on_time.pressures[:-10], rtol=1e-9)


def test_delay_acts_between_samples(parameters, run):
    def at(delay):
        return run(parameters.replaced({"command_delay.delay": delay})).position[400]

    a, b, c = at(3.1e-3), at(3.15e-3), at(3.2e-3)
    assert a != b != c
    assert abs((c - b) - (b - a)) < 0.2 * abs(b - a)


def test_exhaust_restriction_slows_venting_only(parameters):
    fixed = np.zeros(100)
    for sign in (1.0, -1.0):
        commands = np.tile([0.5 * sign, 0.0], (100, 1))
        nominal = simulate_held(parameters, {}, commands=commands, positions=fixed)
        changed = simulate_held(
            parameters, {"exhaust_restriction.ratio": 0.5}, commands=commands, positions=fixed
        )
        gap = changed.pressures[-1, 0] - nominal.pressures[-1, 0]
        assert gap == 0.0 if sign > 0 else gap > 1e3


def test_reservoir_sags_and_recovers_and_keeps_the_mass(parameters):
    commands = np.vstack([np.tile([1.0, 1.0], (200, 1)), np.zeros((800, 2))])
    droop = {"supply_droop.conductance": 1e-9, "supply_droop.volume": 2e-4}
    fixed = np.zeros(1000)
    result = simulate_held(parameters, droop, commands=commands, positions=fixed)
    assert result.reservoir_pressure.min() < 6e5
    assert result.reservoir_pressure[-1] > 0.999 * 701325.0
    # With the refill almost shut, the muscles gain what the reservoir loses.
    droop["supply_droop.conductance"] = 1e-18
    result = simulate_held(parameters, droop, commands=commands, positions=fixed)
    volume = volume_at(parameters, 0.225)
    gas = result.reservoir_pressure * 2e-4 + result.pressures.sum(axis=1) * volume
    np.testing.assert_allclose(gas, gas[0], rtol=1e-7)


def volume_at(parameters, length):
    b, n = parameters["agonist.thread_length"], parameters["agonist.turns"]
    braid = length * (b**2 - length**2) / (4 * np.pi * n**2)
    return braid + parameters["agonist.dead_volume"]


def test_tube_holds_pressure_back_and_keeps_the_mass(parameters):
    commands = np.tile([0.5, -0.5], (1000, 1))
    tube = {"tube_restriction.conductance": 3e-9, "tube_restriction.volume": 1e-5}
    result = simulate_held(parameters, tube, commands=commands, positions=np.zeros(1000))
    assert np.all(result.valve_pressures[1:50, 0] > result.pressures[1:50, 0] + 1e3)
    shut = simulate_held(parameters, tube, shut=True, positions=0.3 * np.sin(np.arange(1000) / 90))
    lengths = shut.lengths
    b, n = parameters["agonist.thread_length"], parameters["agonist.turns"]
    volume = lengths * (b**2 - lengths**2) / (4 * np.pi * n**2) + 2e-5
    gas = (shut.pressures + 101325.0) * volume + (shut.valve_pressures + 101325.0) * 1e-5
    np.testing.assert_allclose(gas, np.broadcast_to(gas[0], gas.shape), rtol=1e-6)


def test_tiny_stiff_tube_stays_stable_and_vanishes(parameters, run):
    wide = {"tube_restriction.conductance": 2e-7, "tube_restriction.volume": 1e-7}
    result = run(parameters.replaced(wide))
    nominal = run(parameters)
    assert np.all(np.isfinite(result.outputs))
    np.testing.assert_allclose(result.position, nominal.position, atol=5e-3)


def test_leak_empties_a_shut_muscle(parameters):
    result = simulate_held(parameters, {"agonist.leakage.conductance": 5e-11}, shut=True)
    assert result.pressures[-1, 0] < 1.9e5
    assert result.position[-1] < -0.02


def test_dead_volume_softens(parameters):
    fixed = np.linspace(0.0, 0.5, 1000)
    nominal = simulate_held(parameters, {}, shut=True, positions=fixed)
    more = simulate_held(parameters, {"dead_volume.extra_volume": 5e-5}, shut=True, positions=fixed)
    assert np.ptp(more.pressures[:, 0]) < np.ptp(nominal.pressures[:, 0])


@pytest.mark.parametrize(("conductance", "exponent"), [(1e-6, 1.4), (1000.0, 1.0)])
def test_thermal_limits_are_adiabatic_and_isothermal(make_rig, conductance, exponent):
    fixed = 0.4 * np.sin(np.arange(500) / 60.0)
    parameters = PlantParameters.from_rig(make_rig())
    limit = PlantParameters.from_rig(make_rig(gas={"polytropic_exponent": exponent}))
    commands = np.zeros((500, 2))
    warm = simulate_held(
        parameters,
        {"thermal.conductance": conductance},
        commands=commands,
        shut=True,
        positions=fixed,
    )
    plain = simulate_held(limit, {}, commands=commands, shut=True, positions=fixed)
    np.testing.assert_allclose(warm.pressures + 101325.0, plain.pressures + 101325.0, rtol=3e-4)
    # The ideal gas law holds at all times.
    lengths = warm.lengths
    b, n = parameters["agonist.thread_length"], parameters["agonist.turns"]
    volume = lengths * (b**2 - lengths**2) / (4 * np.pi * n**2) + 2e-5
    temperature = np.stack([warm["agonist.temperature"], warm["antagonist.temperature"]], axis=1)
    mass = (warm.pressures + 101325.0) * volume / temperature
    np.testing.assert_allclose(mass, np.broadcast_to(mass[0], mass.shape), rtol=1e-7)


def test_filling_warms_and_venting_cools(parameters):
    commands = np.tile([1.0, -1.0], (60, 1))
    result = simulate_held(
        parameters, {"thermal.conductance": 0.5}, commands=commands, positions=np.zeros(60)
    )
    assert result["agonist.temperature"][-1] > 300.0
    assert result["antagonist.temperature"][-1] < 285.0


def loop_work(result, muscle=0):
    """Work that the environment does on a muscle, per sample."""
    length, force = result.lengths[:, muscle], result.forces[:, muscle]
    return np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(length))


def cycles(samples_per_cycle, count=4):
    turns = np.arange(samples_per_cycle * count + 1) / samples_per_cycle
    return 0.5 * np.sin(2 * np.pi * turns)


def regulated(make_rig):
    """Constant pressure during any motion: a fast regulator with a wide valve."""
    valve = {"kind": "pressure_regulator", "time_constant": 0.005, "full_scale": 6e5}
    return PlantParameters.from_rig(make_rig(valve=valve | {"sonic_conductance": 1e-8}))


def test_hysteresis_loses_the_same_at_any_speed(make_rig):
    parameters = regulated(make_rig)
    losses = []
    for samples in (200, 800):
        fixed = cycles(samples)
        commands = np.full((len(fixed), 2), 2e5)
        work = loop_work(
            simulate_held(
                parameters, {"hysteresis.amplitude": 0.05}, commands=commands, positions=fixed
            )
        )
        losses.append(work[-1] - work[-1 - samples])
        free = loop_work(simulate_held(parameters, {}, commands=commands, positions=fixed))
        assert abs(free[-1] - free[-1 - samples]) < 0.02 * losses[-1]
    assert losses[0] > 0.0
    assert losses[0] == pytest.approx(losses[1], rel=0.02)
    # Saturated friction over the stroke in both directions: h p b^2/(4 pi n^2) 4 r a.
    kappa = parameters["agonist.thread_length"] ** 2 / (
        4 * np.pi * parameters["agonist.turns"] ** 2
    )
    assert losses[0] == pytest.approx(0.05 * 2e5 * kappa * 4 * 0.03 * 0.5, rel=0.1)


def test_hysteresis_grows_with_pressure(make_rig):
    parameters = regulated(make_rig)
    fixed = cycles(400)
    loss = []
    for pressure in (1e5, 3e5):
        commands = np.full((len(fixed), 2), pressure)
        result = simulate_held(
            parameters,
            {"hysteresis.amplitude": 0.05},
            commands=commands,
            positions=fixed,
            pressures=(pressure, pressure),
        )
        # The states start at command 0: the regulator settles first, then the last cycle is used.
        work = loop_work(result)
        loss.append(work[-1] - work[-401])
    assert loss[1] == pytest.approx(3.0 * loss[0], rel=0.05)


def test_creep_relaxes_after_a_step_and_dissipates(parameters):
    creep = {"creep.ratio": 0.1, "creep.time_constant": 0.4}
    n = parameters["agonist.turns"]
    stiffness = 0.1 * 3e5 * 6 * parameters["agonist.rest_length"] / (4 * np.pi * n**2)
    steps = np.where(np.arange(1000) < 5, 0.0, 0.3)
    pressure = np.full((1000, 2), 2e5)

    def driven(changes, positions):
        changed = parameters.replaced(changes)
        state = initial_state(changed, pressures=(2e5, 2e5))
        return simulate(
            changed, HELD[: len(positions)], DT, state, positions=positions,
            pressures=pressure[: len(positions)],
        )  # fmt: skip

    extra = driven(creep, steps).forces - driven({}, steps).forces
    # The antagonist is stretched by 0.3 r, and the bladder relaxes with its time constant.
    assert extra[5, 1] == pytest.approx(stiffness * 0.03 * 0.3, rel=0.01)
    assert extra[5 + 200, 1] / extra[5, 1] == pytest.approx(np.exp(-1.0), rel=1e-3)
    np.testing.assert_allclose(extra[:4], 0.0, atol=1e-9)
    work = loop_work(driven(creep, cycles(240, 4)))
    assert work[-1] - work[-241] > 0.1


def test_creep_of_a_fresh_bladder_pulls_towards_its_rest_length(parameters):
    creep = parameters.replaced({"creep.ratio": 0.1, "creep.time_constant": 0.4})
    fresh = initial_state(creep, pressures=(2e5, 2e5), creep_settled=False)
    still = np.zeros(1000)
    result = simulate(creep, HELD, DT, fresh, shut=True, positions=still).forces[:, 0]
    settled = initial_state(creep, pressures=(2e5, 2e5))
    rest = simulate(creep, HELD, DT, settled, shut=True, positions=still).forces[:, 0]
    np.testing.assert_allclose(rest, rest[0], rtol=1e-9)
    assert result[0] < rest[0]
    assert result[-1] == pytest.approx(rest[-1], rel=2e-3)


def test_bladder_stiffens_and_end_caps_shorten_the_stroke(parameters):
    fixed = np.linspace(-0.8, 0.8, 1000)
    nominal = simulate_held(parameters, {}, positions=fixed, shut=True)
    stiff = simulate_held(
        parameters, {"bladder_elasticity.linear": 500.0}, positions=fixed, shut=True
    )
    stretch = nominal.lengths - parameters["agonist.rest_length"]
    np.testing.assert_allclose(stiff.forces - nominal.forces, 500.0 * stretch, atol=1e-6)
    caps = simulate_held(parameters, {"end_caps.factor": 1.2}, positions=fixed, shut=True)
    short = nominal.lengths < parameters["agonist.rest_length"]
    assert np.all(caps.forces[short] < nominal.forces[short])


def test_braid_that_stretches_pulls_less_and_holds_more(parameters):
    stretch = {"braid_extensibility.compliance": 2e-7}
    fixed = np.zeros(1000)
    nominal = simulate_held(parameters, {}, positions=fixed, shut=True)
    soft = simulate_held(parameters, stretch, positions=fixed, shut=True)
    b, n, p, length = 0.2758, 1.856, 2e5, 0.225
    grown = b / (1 - 2e-7 * p * length)
    expected = p * (3 * length**2 - grown**2) / (4 * np.pi * n**2)
    assert soft.forces[0, 0] == pytest.approx(expected, rel=1e-12)
    assert soft.forces[0, 0] < nominal.forces[0, 0]
    # The same air raises the pressure less, because the volume is larger.
    commands = np.tile([0.5, 0.0], (200, 1))
    full = simulate_held(parameters, {}, positions=fixed[:200], commands=commands)
    less = simulate_held(parameters, stretch, positions=fixed[:200], commands=commands)
    assert less.pressures[100, 0] < full.pressures[100, 0]


@pytest.mark.parametrize("thread", [0.0, 2e-7])
def test_cable_stretches_by_its_force_and_keeps_the_gas(parameters, thread):
    changes = {"cable_compliance.compliance": 2e-5, "braid_extensibility.compliance": thread}
    fixed = 0.4 * np.sin(np.arange(1000) / 70.0)
    result = simulate_held(parameters, changes, positions=fixed, shut=True)
    path = 0.225 - 0.03 * fixed
    np.testing.assert_allclose(path - result.lengths[:, 0], 2e-5 * result.forces[:, 0], atol=1e-10)
    length, pressure = result.lengths[:, 0], result.pressures[:, 0]
    b, n = 0.2758, 1.856
    grown = b / (1 - thread * pressure * length)
    volume = length * (grown**2 - length**2) / (4 * np.pi * n**2) + 2e-5
    gas = (pressure + 101325.0) * volume
    np.testing.assert_allclose(gas, gas[0], rtol=1e-7)


def test_payload_hangs_and_swings_slower(parameters):
    vented = (0.0, 0.0)
    load = {"payload.mass": 1.0, "payload.distance": 0.3}

    def period(changes):
        changes = changes | {"joint.viscous_friction": 0.0}
        result = simulate_held(
            parameters, changes, pressures=vented, position=0.05,
            commands=np.tile([-1.0, -1.0], (1000, 1)),
        )  # fmt: skip
        crossings = np.flatnonzero(np.diff(np.sign(result.position)) != 0)
        return 2 * DT * np.mean(np.diff(crossings))

    for changes, inertia, torque in (({}, 0.05, 4.9), (load, 0.05 + 0.09, 4.9 + 0.3 * 9.80665)):
        expected = 2 * np.pi * np.sqrt(inertia / torque)
        assert period(changes) == pytest.approx(expected, rel=0.02)


def test_viscous_friction_and_radius(parameters):
    push = {"pressures": (2.2e5, 2e5), "shut": True}
    slow = simulate_held(parameters, {"viscous_friction.extra": 2.0}, **push)
    fast = simulate_held(parameters, {}, **push)
    assert np.max(np.abs(slow.velocity)) < np.max(np.abs(fast.velocity))
    arm = simulate_held(parameters, {"pulley_radius.scale": 1.2}, **push)
    assert arm.torque[0] == pytest.approx(1.2 * fast.torque[0], rel=1e-12)


def test_sensors_show_offset_delay_gain_bias_and_lag(parameters, run):
    plain = run(parameters)
    changed = parameters.replaced(
        {
            "position_offset.offset": 0.1,
            "position_delay.delay": 5 * DT,
            "agonist.pressure_gain.gain": 1.1,
            "antagonist.pressure_bias.bias": 3e3,
        }
    )
    shown = simulate_measured(changed, run(changed))
    np.testing.assert_allclose(shown.position[5:], plain.position[:-5] + 0.1, atol=1e-12)
    np.testing.assert_allclose(shown.pressures[:, 0], 1.1 * plain.pressures[:, 0])
    np.testing.assert_allclose(shown.pressures[:, 1], plain.pressures[:, 1] + 3e3)
    lagging = parameters.replaced({"pressure_lag.time_constant": 0.05})
    filtered = simulate_measured(lagging, run(lagging)).pressures[:, 0]
    # A ramp through a first-order lag is late by its time constant.
    rate = np.gradient(filtered, DT)
    np.testing.assert_allclose((filtered + 0.05 * rate)[5:-5], plain.pressures[5:-5, 0], atol=300.0)


def test_driving_undoes_the_sensors(parameters, run):
    changed = parameters.replaced(
        {"position_offset.offset": 0.1, "agonist.pressure_gain.gain": 1.1}
    )
    truth = run(changed)
    shown = simulate_measured(changed, truth)
    state = initial_state(changed, pressures=(2e5, 2e5))
    driven = simulate(
        changed, np.zeros((600, 2)), DT, state, positions=shown.position, pressures=shown.pressures
    )
    np.testing.assert_allclose(driven.forces, truth.forces, rtol=1e-6)


def test_neutral_values_name_every_effect(parameters):
    values = neutral_values()
    assert {key.removeprefix("antagonist.").split(".")[0] for key in values if "ant" in key[:3]}
    np.testing.assert_array_equal(parameters.replaced(values).values, parameters.values)
