"""The second plant: the nominal rig without effects, and each effect in its own stage."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from pam_check.blind.campaign import DrawnFrom
from pam_check.blind.cases import make_cases, rig_parameters
from pam_check.blind.draw import Draw, draw_excitation
from pam_check.blind.effect_cases import KNOWN, OUTSIDE, case_of, stage_of
from pam_check.blind.plants import PLANTS
from pam_check.blind.second_laws import (
    braid_volume,
    cable_tension,
    hysteresis_rate,
    ogden_pull,
    pull,
    thread,
)
from pam_check.blind.second_plant import STEP, laminar, muscle_of, run_second, tube_of
from pam_check.blind.truth_plant import (
    PressureExcitation,
    Sensors,
    SupplyWander,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
    run_truth,
)
from pam_check.commands.blind import COMMANDS
from pam_model.command_line import Parser
from pam_model.errors import PamError
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import rig_from_parameters

JOINT = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
MUSCLE = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)
QUIET = Sensors(0.0, 1e-3, 0.0, 1e-9, 0.0, 1e-6)
DT = 0.002
WARM = 287.05 * 293.15
pytest.importorskip("numba", reason="the plants are some 300 times slower without numba")

Vector = npt.NDArray[np.float64]


def motion(seconds: float = 5.0) -> PressureExcitation:
    time = np.arange(round(seconds / DT)) * DT
    wave = 7e4 * np.sin(2 * math.pi * 0.6 * time) * np.clip(time, 0, 1)
    return PressureExcitation(np.full(time.size, 2.4e5), wave, np.zeros(time.size), DT)


def run(
    joint: TruthJoint = JOINT,
    muscles: tuple[TruthMuscle, TruthMuscle] = (MUSCLE, MUSCLE),
    commands: Vector | None = None,
    seconds: float = 5.0,
    step: float = STEP,
) -> TruthRecording:
    random = np.random.default_rng(0)
    return run_second(
        joint, muscles, motion(seconds), QUIET, random, fixed_commands=commands, step=step
    )


def rig_with(effect: str) -> tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle]]:
    draw = Draw(np.random.default_rng(5), JOINT, [MUSCLE, MUSCLE])
    case_of(effect).draw(draw)
    return draw.joint, (draw.muscles[0], draw.muscles[1])


def test_with_nothing_hidden_both_plants_and_the_simulation_agree() -> None:
    """The contract's nominal rig has one form: no difference that a sensor would see."""
    first = run_truth(JOINT, (MUSCLE, MUSCLE), motion(), QUIET, np.random.default_rng(0))
    second = run(commands=first.commands)
    parameters = PlantParameters.from_rig(rig_from_parameters(rig_parameters(JOINT, MUSCLE, 0.0)))
    start = initial_state(parameters, pressures=(2.4e5, 2.4e5), position=0.0)
    nominal = simulate(parameters, first.commands, DT, start)
    assert np.ptp(second.true_position) > 0.5
    assert np.abs(second.true_position - first.true_position).max() < 2e-4
    assert np.abs(second.true_pressures - first.true_pressures).max() < 20.0
    assert np.abs(second.true_position - nominal.position).max() < 1e-6
    assert np.abs(second.true_pressures - nominal.pressures).max() < 0.1


def rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def flow_into(spool: Vector, pressure: Vector) -> Vector:
    """Nominal mass flow [kg/s] into a muscle of this absolute pressure (ISO 6358)."""
    high = np.where(spool > 0.0, JOINT.supply_pressure, pressure)
    low = np.where(spool > 0.0, pressure, JOINT.ambient_pressure)
    b = MUSCLE.critical_ratio
    over = np.clip((low / high - b) / (1.0 - b), 0.0, 1.0)
    return MUSCLE.sonic_conductance * spool * 1.185 * high * np.sqrt(1.0 - over**2)


def spool_of(commands: Vector) -> Vector:
    """Nominal spool: it follows the command of the last sample with one lag."""
    kept, spool = math.exp(-DT / MUSCLE.time_constant), np.zeros(commands.size)
    for k in range(1, commands.size):
        spool[k] = commands[k - 1] + (spool[k - 1] - commands[k - 1]) * kept
    return spool


def marks(made: TruthRecording) -> dict[str, float]:
    """How far each stage is from its nominal law, as a share of what comes out of it."""
    q, inner = made.true_position, slice(1, -1)
    speed = (q[2:] - q[:-2]) / (2 * DT)
    bends = (q[2:] - 2 * q[1:-1] + q[:-2]) / DT**2
    torque = JOINT.pulley_radius * (made.forces[:, 0] - made.forces[:, 1])[inner]
    gravity = JOINT.gravity_torque * np.sin(q[inner])
    joint = JOINT.inertia * bends - torque + JOINT.viscous_friction * speed + gravity
    muscle, valve, flows = [], [], []
    for i in range(2):
        length = MUSCLE.neutral_length - (1 - 2 * i) * JOINT.pulley_radius * q
        pressure = made.true_pressures[:, i]
        braid = MUSCLE.thread_length**2 - length**2
        share = 4 * math.pi * MUSCLE.turns**2
        muscle.append(made.forces[:, i] - pressure * (2 * length**2 - braid) / share)
        spool = spool_of(made.commands[:, i])
        gas = (pressure + JOINT.ambient_pressure) * (MUSCLE.dead_volume + length * braid / share)
        grows = (gas[2:] - gas[:-2]) / (2 * DT)
        flow = flow_into(spool, pressure + JOINT.ambient_pressure)
        flows.append(flow)
        valve.append(grows / WARM - flow[inner])
    seen = np.c_[(made.pressures - made.true_pressures) / 1e5, made.position - q]
    return {
        "joint": rms(joint) / rms(torque), "muscle": rms(np.array(muscle)) / rms(made.forces),
        "valve": rms(np.array(valve)) / rms(np.array(flows)), "sensing": rms(seen),
    }  # fmt: skip


SMALL = 1e-3  # the differences in time of sampled signals see no less
ALSO = {
    "tube_restriction": {"sensing"},  # the sensor is at its other end
    "end_caps": {"valve"},  # they change the gas volume
    "braid_extensibility": {"valve"},
    "cable_compliance": {"valve"},
    "pulley_radius": {"muscle", "valve"},  # it changes the lengths
}


@pytest.fixture(scope="module")
def plain() -> dict[str, float]:
    """The marks of the nominal rig."""
    return marks(run())


@pytest.mark.parametrize("effect", list(KNOWN))
def test_an_effect_breaks_the_nominal_law_of_its_stage_alone(
    effect: str, plain: dict[str, float]
) -> None:
    changed = marks(run(*rig_with(effect)))
    stage = stage_of(effect)
    assert changed[stage] > 4.0 * plain[stage] + SMALL
    for other in plain.keys() - {stage} - ALSO.get(effect, set()):
        assert changed[other] < 2.0 * plain[other] + SMALL, other


@pytest.mark.sampled("ten of the effects, all of which one loop integrates", cases=10)
@pytest.mark.parametrize("effect", [*KNOWN, *OUTSIDE])
def test_half_the_step_gives_the_same_recording(effect: str) -> None:
    joint, muscles = rig_with(effect)
    whole = run(joint, muscles, seconds=2.0)
    half = run(joint, muscles, whole.commands, 2.0, 0.5 * STEP)
    assert np.abs(whole.true_pressures - half.true_pressures).max() < 30.0
    assert np.abs(whole.true_position - half.true_position).max() < 2e-4


def test_thread_friction_takes_energy_from_every_loop() -> None:
    m = muscle_of(MUSCLE._replace(thread_friction=0.01, play_length=1e-3))
    for reach in (2e-4, 1e-3, 8e-3):
        state, work = 0.0, np.zeros(40000)
        path = MUSCLE.neutral_length + reach * np.sin(np.linspace(0.0, 8 * math.pi, 40001))
        for k, dx in enumerate(np.diff(path)):
            state += hysteresis_rate(m, state, dx)
            with_it, without = (pull(m, 3e5, path[k], z, 0.0, path[k]) for z in (state, 0.0))
            work[k] = (with_it - without) * dx
        loops = work.reshape(4, -1).sum(axis=1)
        assert loops.min() > 0.0
        assert loops[3] == pytest.approx(loops[2], rel=0.3)


@pytest.mark.parametrize("change", [{"end_factor": 1.2}, {"thread_compliance": 3e-5}])
def test_the_pull_is_the_work_of_the_gas(change: dict[str, float]) -> None:
    """Virtual work: pull = -p dV/dL with the threads held, whatever their elastic energy."""
    m = muscle_of(MUSCLE._replace(**change))
    for length in (0.20, 0.22, 0.24):
        b = thread(m, 2e5, length)
        by_length = (braid_volume(m, b, length + 1e-5) - braid_volume(m, b, length - 1e-5)) / 2e-5
        assert pull(m, 2e5, length, 0.0, 0.0, length) == pytest.approx(-2e5 * by_length, rel=1e-5)


def test_rubber_and_cable_resist() -> None:
    m = muscle_of(MUSCLE._replace(bladder_volume=1e-5, bladder_modulus=1e6, cable_compliance=1e-5))
    rest = MUSCLE.rest_length
    assert ogden_pull(m, rest) == pytest.approx(0.0, abs=1e-9)
    assert ogden_pull(m, rest - 0.01) < 0.0 < ogden_pull(m, rest + 0.005)
    assert cable_tension(m, -1e-3) == 0.0
    assert 0.0 < 2 * cable_tension(m, 2e-3) < cable_tension(m, 4e-3)


def locked(muscle: TruthMuscle, commands: Vector) -> TruthRecording:
    fixed = JOINT._replace(inertia=1e9, gravity_torque=0.0)
    return run(fixed, (muscle, muscle), commands, commands.shape[0] * DT)


def resting_volume() -> float:
    length = MUSCLE.neutral_length
    braid = length * (MUSCLE.thread_length**2 - length**2) / (4 * math.pi * MUSCLE.turns**2)
    return braid + MUSCLE.dead_volume


def test_a_tube_delays_a_pressure_and_keeps_where_it_ends() -> None:
    commands = np.zeros((3000, 2))
    commands[100:200] = 0.2
    long = MUSCLE._replace(tube_volume=2e-5, tube_conductance=2e-9)
    made = locked(long, commands)
    diameter, length = tube_of(2e-5, 2e-9)
    assert math.pi / 4 * diameter**2 * length == pytest.approx(2e-5, rel=1e-6)
    risen = made.true_pressures[:, 0] - made.true_pressures[0, 0]
    entered = made.pressures[:, 0] - made.pressures[0, 0]
    first, second = (int(np.argmax(x > 200.0)) for x in (entered, risen))
    assert (second - first) * DT == pytest.approx(length / 343.0, abs=0.004)
    assert made.true_pressures[-1, 0] == pytest.approx(made.pressures[-1, 0], abs=2.0)
    spool = spool_of(commands[:, 0])
    gas = np.trapezoid(flow_into(spool, made.pressures[:, 0] + JOINT.ambient_pressure), dx=DT)
    assert risen[-1] == pytest.approx(gas * WARM / (resting_volume() + 2e-5 + 5e-7), rel=0.01)


def test_a_leak_empties_a_muscle_as_a_narrow_gap_does() -> None:
    """dP/dt = -G R T (P^2 - Pa^2)/V, whose solution is P = Pa coth(a t + c)."""
    made = locked(MUSCLE._replace(leak=2e-10), np.zeros((2000, 2)))
    ambient = JOINT.ambient_pressure
    rate = laminar(2e-10) * WARM * ambient / resting_volume()
    begin = math.atanh(ambient / (2.4e5 + ambient))
    exact = ambient / np.tanh(rate * made.time + begin) - ambient
    assert exact[-1] < 2.2e5
    assert made.true_pressures[:, 0] == pytest.approx(exact, abs=1.0)


def test_an_ordinary_background_is_as_small_as_that_of_the_first_plant() -> None:
    commands, wander = run().commands, SupplyWander(0.01, 8.0, 1e-3, 15.0)
    sensors = Sensors(pressure_colour=150.0, pressure_drift=500.0, position_drift=2e-4)
    changes = []
    for plant in PLANTS.values():
        made, plain = (
            plant(
                JOINT, (MUSCLE, MUSCLE), motion(), sensors, np.random.default_rng(1),
                fixed_commands=commands, supply=supply,
            )
            for supply in (wander, None)
        )  # fmt: skip
        noise = rms(plain.pressures - plain.true_pressures)
        changes.append((rms(made.true_pressures - plain.true_pressures), noise))
    for one, other in zip(*changes, strict=True):
        assert 0.3 < one / other < 3.0


def test_both_plants_get_the_same_draw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command offers what there is, and the rig files of one seed are the same."""
    short = partial(draw_excitation, duration=10.0)
    monkeypatch.setattr("pam_check.blind.cases.draw_excitation", short)
    parser = Parser()
    COMMANDS[0].declare(parser)
    choices = next(a.choices for a in parser._actions if a.dest == "plant")
    assert list(choices or ()) == list(PLANTS)
    for plant in PLANTS:
        make_cases(2, 11, tmp_path / plant, tmp_path / f"{plant}-sealed", plant=plant)
    for case in ("000", "001"):
        rigs = {(tmp_path / plant / case / "rig.yaml").read_text() for plant in PLANTS}
        logs = {(tmp_path / plant / case / "recording.csv.gz").read_bytes() for plant in PLANTS}
        assert (len(rigs), len(logs)) == (1, 2)


def test_a_campaign_of_one_plant_is_not_resumed_with_the_other(tmp_path: Path) -> None:
    DrawnFrom(2, 5, False).seal(tmp_path, "digest")
    assert DrawnFrom(2, 5, False).sealed_in(tmp_path) == "digest"
    with pytest.raises(PamError, match="--plant"):
        DrawnFrom(2, 5, False, "second").sealed_in(tmp_path)
    seal = tmp_path / "seal.json"
    seal.write_text(seal.read_text().replace(',\n  "plant": "first"', ""))
    assert '"plant"' not in seal.read_text()
    assert DrawnFrom(2, 5, False).sealed_in(tmp_path) == "digest"
