"""The nominal plant: another solver, symmetry, energy, convergence and domain."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.plant import layout as lay
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.kernel import record
from pam_model.plant.parameters import INDEX, NAMES, UNITS, PlantParameters
from pam_model.plant.simulate import Plant, initial_state, simulate

from .reference_plant import solve

HELD = np.zeros((500, 2))


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"gas": {"polytropic_exponent": 1.3}},
        {"joint": {"gravity_angle": 0.4, "gravity_torque": 2.0}},
        {"valve": {"critical_ratio": 0.45, "time_constant": 0.02}},
        {"gas": {"temperature": 310.0}, "supply_pressure": 501325.0},
    ],
)
def test_agrees_with_another_solver(make_rig, run, wiggle, changes):
    rig = make_rig(**changes)
    mine = run(PlantParameters.from_rig(rig))
    other = solve(rig, wiggle[0], wiggle[1], (2e5, 2e5))
    assert np.ptp(mine.position) > 0.3
    np.testing.assert_allclose(mine.position, other[:, 0], atol=2e-6)
    np.testing.assert_allclose(mine.velocity, other[:, 1], atol=1e-4)
    absolute = mine.pressures + rig.gas.ambient_pressure
    np.testing.assert_allclose(absolute, other[:, [3, 5]], rtol=3e-6)


def test_fourth_order_convergence(parameters, run):
    # Valves are shut because the flow law has kinks; all other laws are smooth.
    def last(step):
        return run(parameters, position=0.5, shut=True, step=step).position[-1]

    exact = last(1.25e-4)
    coarse, fine = (abs(last(step) - exact) for step in (2e-3, 1e-3))
    assert 12.0 < coarse / fine < 20.0


def test_the_torque_of_an_uneven_pulley_is_the_virtual_work_of_its_muscles(parameters):
    constants = derive_constants(parameters.values)
    constants[lay.C_ARM_SLOPE], constants[lay.C_ARM_BEND] = 0.4, -0.3
    tables = tuple(for_kernel(table) for table in parameters.tables)

    def outputs(position):
        state = initial_state(parameters, pressures=(3e5, 1.5e5), position=position)
        found = np.zeros(lay.outputs_of(2))
        row = for_kernel(found)
        record(for_kernel(constants), tables, for_kernel(state), row)
        return np.array(row)

    muscles = (lay.outputs_of(0), lay.outputs_of(1))
    for position in (-0.5, 0.0, 0.6):
        ahead, here, behind = (outputs(position + d) for d in (1e-6, 0.0, -1e-6))
        slopes = [(ahead[m + lay.O_LENGTH] - behind[m + lay.O_LENGTH]) / 2e-6 for m in muscles]
        work = -sum(here[m + lay.O_FORCE] * s for m, s in zip(muscles, slopes, strict=True))
        assert here[lay.O_TORQUE] == pytest.approx(work, rel=1e-6)


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4])
def test_energy_of_shut_chambers_is_conserved(make_rig, run, exponent):
    rig = make_rig(gas={"polytropic_exponent": exponent}, joint={"viscous_friction": 0.0})
    parameters = PlantParameters.from_rig(rig)
    result = run(parameters, commands=HELD, position=0.4, velocity=1.0, shut=True)
    joint, muscle, ambient = rig.joints[0], rig.muscles[0], rig.gas.ambient_pressure
    b, n = muscle.thread_length, muscle.turns
    lengths = result.lengths
    volume = lengths * (b**2 - lengths**2) / (4 * np.pi * n**2) + muscle.dead_volume
    absolute = result.pressures + ambient
    # P V^k is constant, and so is the sum of kinetic, potential, gas and displacement energy.
    invariant = absolute * volume**exponent
    np.testing.assert_allclose(invariant, np.broadcast_to(invariant[0], invariant.shape), rtol=1e-9)
    if exponent == 1.0:
        gas = -invariant[0] * np.log(volume)
    else:
        gas = absolute * volume / (exponent - 1.0)
    energy = (
        0.5 * joint.inertia * result.velocity**2
        - joint.gravity_torque * np.cos(result.position)
        + np.sum(gas + ambient * volume, axis=1)
    )
    assert np.ptp(0.5 * joint.inertia * result.velocity**2) > 0.01
    np.testing.assert_allclose(energy, energy[0], atol=1e-7)


def test_swapping_the_muscles_mirrors_the_motion(parameters, run, wiggle):
    one = run(parameters)
    other = run(parameters, commands=wiggle[0][:, ::-1])
    np.testing.assert_allclose(one.position, -other.position, atol=1e-12)
    np.testing.assert_allclose(one.pressures, other.pressures[:, ::-1], rtol=1e-12)


def test_end_stops_hold_without_bouncing(parameters, run):
    commands = np.tile([1.0, -1.0], (1500, 1))
    result = run(parameters, commands=commands)
    assert result.position[-1] == 1.0
    assert result.velocity[-1] == 0.0
    reached = np.argmax(result.position >= 1.0)
    assert np.all(result.position[reached:] == 1.0)


def test_heavy_damping_takes_shorter_steps(make_rig, run):
    """A damper whose speed settles within less than a step made the plant diverge."""
    light = {"inertia": 1e-3, "viscous_friction": 8.0, "gravity_torque": 0.1}
    parameters = PlantParameters.from_rig(make_rig(joint=light))
    usual, fine = (run(parameters, step=step).position for step in (2e-3, 5e-5))
    assert np.ptp(fine) > 0.1
    np.testing.assert_allclose(usual, fine, atol=1e-5)


def test_long_stroke_stays_inside_the_braid(make_rig, run):
    rig = make_rig(joint={"position_limits": (-3.0, 3.0)})
    result = run(PlantParameters.from_rig(rig), commands=np.tile([1.0, -1.0], (1500, 1)))
    assert np.all(np.isfinite(result.outputs))
    assert np.all(result.lengths <= rig.muscles[0].thread_length)
    assert np.all(result.pressures > -rig.gas.ambient_pressure)


def test_muscles_never_push(parameters, run):
    result = run(parameters, commands=np.tile([-1.0, -1.0], (1000, 1)))
    assert np.all(result.forces >= 0.0)
    short = run(parameters, pressures=(-2e4, 1e5), commands=HELD, shut=True)
    assert short.forces[0, 0] == 0.0


def test_regulator_follows_and_is_limited_by_its_flow(make_rig, run):
    valve = {"kind": "pressure_regulator", "time_constant": 0.02, "full_scale": 6e5}
    commands = np.tile([3e5, 1e5], (600, 1))
    wide = make_rig(valve=valve | {"sonic_conductance": 1e-6})
    result = run(PlantParameters.from_rig(wide), commands=commands, pressures=(0.0, 0.0))
    time = np.arange(600) * 2e-3
    x = time / 0.02
    expected = 3e5 * (1.0 - (1.0 + x) * np.exp(-x))  # two equal lags
    # It starts settled at command 0; the valve is so wide that only the lag remains.
    np.testing.assert_allclose(result.pressures[:, 0], expected, atol=300.0)
    narrow = make_rig(valve=valve | {"sonic_conductance": 2e-9})
    slow = run(PlantParameters.from_rig(narrow), commands=commands, pressures=(0.0, 0.0))
    assert slow.pressures[50, 0] < 0.5 * result.pressures[50, 0]
    np.testing.assert_allclose(slow.pressures[-1], (3e5, 1e5), rtol=0.02)


def test_prescribed_signals_reproduce_the_free_run(parameters, run):
    free = run(parameters)
    gas = run(parameters, positions=free.position)
    np.testing.assert_allclose(gas.pressures, free.pressures, rtol=2e-3)
    motion = run(parameters, pressures=(2e5, 2e5))
    driven = simulate_driven(parameters, free)
    np.testing.assert_allclose(driven.position, motion.position, atol=2e-4)


def simulate_driven(parameters, free):
    state = initial_state(parameters, pressures=(2e5, 2e5))
    return simulate(parameters, np.zeros((600, 2)), 2e-3, state, pressures=free.pressures)


def test_stepping_equals_running(parameters, run, wiggle):
    whole = run(parameters)
    plant = Plant(parameters, state=initial_state(parameters, pressures=(2e5, 2e5)))
    shown = [plant.step(u, wiggle[1]) for u in wiggle[0][:-1]]
    np.testing.assert_array_equal([row[0] for row in shown], whole.position[1:])
    np.testing.assert_array_equal([row[1:] for row in shown], whole.pressures[1:])
    assert plant.output["agonist.force"] == whole.forces[-1, 0]


def test_stepping_with_delays_equals_running(parameters, run, wiggle):
    late = parameters.replaced(
        {
            "agonist.command_delay.delay": 0.0133,
            "antagonist.command_delay.delay": 0.004,
            "position_delay.delay": 0.0071,
            "pressure_lag.time_constant": 0.012,
        }
    )
    from pam_model.plant.simulate import simulate_measured

    whole = simulate_measured(late, run(late))
    plant = Plant(late, state=initial_state(late, pressures=(2e5, 2e5)))
    shown = [plant.step(u, wiggle[1]) for u in wiggle[0][:-1]]
    np.testing.assert_allclose([r[0] for r in shown][10:], whole.position[11:], atol=1e-12)
    # The filters start one sample apart; this decays within some time constants.
    np.testing.assert_allclose([r[1:] for r in shown][200:], whole.pressures[201:], rtol=1e-6)


def test_batch_equals_single_lanes(parameters, run, wiggle):
    changed = parameters.replaced({"leakage.conductance": 1e-11, "coulomb_friction.torque": 0.2})
    values = np.stack([parameters.values, changed.values])
    state = initial_state(parameters, pressures=(2e5, 2e5))
    for threads in (1, 2):
        batch = simulate(parameters, *wiggle, state, values=values, threads=threads)
        for lane, single in enumerate((parameters, changed)):
            alone = simulate(single, *wiggle, state)
            np.testing.assert_array_equal(batch.outputs[lane], alone.outputs)


def test_goes_on_from_the_final_state(parameters, run, wiggle):
    whole = run(parameters)
    first = run(parameters, commands=wiggle[0][:250])
    second = simulate(parameters, wiggle[0][250:], wiggle[1], first.final_state)
    np.testing.assert_array_equal(second.position, whole.position[250:])


def test_names_cover_the_table_of_effects(parameters):
    assert len(set(NAMES)) == len(NAMES) == len(UNITS) == len(parameters.values)
    for effect in EFFECTS.values():
        for key, entry in effect.parameters.items():
            side = "antagonist." if effect.scope == "muscle" else ""
            assert parameters[f"{side}{effect.name}.{key}"] == entry.neutral


def test_effects_of_the_rig_file_enter(make_rig, rig):
    muscle = rig.muscles[1]
    hidden = make_rig(joint={"effects": {"coulomb_friction": {"torque": 0.3}}})
    from dataclasses import replace

    hidden = hidden.with_muscle(replace(muscle, effects={"leakage": {"conductance": 2e-11}}))
    hidden = replace(hidden, effects={"supply_droop": {"conductance": 5e-9}})
    parameters = PlantParameters.from_rig(hidden)
    assert parameters["coulomb_friction.torque"] == 0.3
    assert parameters["agonist.leakage.conductance"] == 0.0
    assert parameters["antagonist.leakage.conductance"] == 2e-11
    assert parameters["supply_droop.conductance"] == 5e-9
    plain = PlantParameters.from_rig(hidden.without_effects())
    np.testing.assert_array_equal(plain.values, PlantParameters.from_rig(rig).values)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: p.replaced({"leek.conductance": 1.0}), "leek"),
        (lambda p: p.replaced({"leakage.conductance": np.nan}), "= nan m"),
        (lambda p: simulate(p, np.zeros((5, 3)), 2e-3), "commands has shape"),
        (lambda p: simulate(p, np.full((5, 2), np.nan), 2e-3), "not finite"),
        (lambda p: simulate(p, np.zeros((5, 2)), 0.0), "above 0"),
        (lambda p: simulate(p, np.zeros((5, 2)), 2e-3, positions=np.zeros(4)), "positions"),
        (lambda p: simulate(p, np.zeros((5, 2)), 2e-3, pressures=np.zeros(5)), "pressures"),
    ],
)
def test_bad_arguments_are_named(parameters, call, message):
    with pytest.raises(PamError, match=message):
        call(parameters)


PLAIN = """
import sys, numpy as np
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.simulate import initial_state, simulate
from pam_model.plant import layout as lay
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.kernel import record
from pam_model.plant.parameters import PlantParameters
assert not HAVE_NUMBA
values, commands, state = np.load(sys.argv[1]).values()
result = simulate(PlantParameters(values), commands, 2e-3, state)
np.save(sys.argv[2], result.outputs)
"""

EVERYTHING = {
    "valve_dead_zone.overlap": 0.05,
    "agonist.valve_null_offset.offset": 0.03,
    "valve_lag.extra_time_constant": 0.004,
    "exhaust_restriction.ratio": 0.6,
    "supply_droop.conductance": 8e-9,
    "tube_restriction.conductance": 1.2e-8,
    "command_delay.delay": 0.0041,
    "leakage.conductance": 2e-11,
    "dead_volume.extra_volume": 1e-5,
    "thermal.conductance": 0.8,
    "hysteresis.amplitude": 0.05,
    "creep.ratio": 0.05,
    "bladder_elasticity.linear": 300.0,
    "bladder_elasticity.cubic": 1e5,
    "end_caps.factor": 1.05,
    "threshold_pressure.pressure": 2e4,
    "braid_extensibility.compliance": 5e-8,
    "cable_compliance.compliance": 1e-5,
    "coulomb_friction.torque": 0.2,
    "stribeck_friction.static_torque": 0.3,
    "stribeck_friction.torque": 0.1,
    "viscous_friction.extra": 0.1,
    "payload.mass": 0.5,
    "pulley_radius.scale": 1.03,
}


@pytest.mark.parametrize(
    ("switch", "changes"), [("NUMBA_DISABLE_JIT", {}), ("PAM_NO_NUMBA", EVERYTHING)]
)
def test_plain_python_gives_the_same(parameters, run, wiggle, tmp_path, switch, changes):
    changed = parameters.replaced(changes)
    commands = wiggle[0][:150]
    state = initial_state(changed, pressures=(2e5, 2e5))
    given, got = tmp_path / "in.npz", tmp_path / "out.npy"
    np.savez(given, values=changed.values, commands=commands, state=state)
    environment = os.environ | {switch: "1"}
    subprocess.run(
        [sys.executable, "-c", PLAIN, str(given), str(got)],
        check=True,
        env=environment,
        timeout=120,
    )
    here = simulate(changed, commands, 2e-3, state)
    np.testing.assert_allclose(here.outputs, np.load(got), rtol=1e-9, atol=1e-9)


def test_index_points_at_names():
    assert all(NAMES[i] == name for name, i in INDEX.items())
