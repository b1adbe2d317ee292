"""The controller on the independent plant: the loop is closed rightly, and the baseline is one."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_check.__main__ import main
from pam_check.blind.effect_cases import KNOWN, size_of
from pam_check.blind.hidden_size import CLEAN
from pam_check.blind.truth_plant import PressureExcitation, Sensors, run_truth
from pam_check.control.closed_loop import PERIOD, TOLD, PlayedRun, play, true_rig
from pam_check.control.rough_control import RoughControl, RoughResult
from pam_check.control.running_truth import RunningTruth
from pam_check.control.tuned_pid import TuningBench, tune
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")

BASELINE = "concerns the baseline of a benchmark alone, not what runs on a robot"


@pytest.fixture(scope="module")
def rough():
    return RoughControl(load_rig(ELBOW), TOLD, 5)


def test_the_plant_sample_by_sample_is_the_plant_of_the_blind_check(rough):
    joint, muscles = rough.hidden("hysteresis")
    count, sensors = 400, Sensors(pressure_noise=0.0, position_noise=0.0, force_noise=0.0)
    wave = 0.1 * np.sin(np.arange(count) * 0.05)
    commands = np.stack([wave, -wave], axis=1)
    flat = np.full(count, 2e5)
    excitation = PressureExcitation(flat, np.zeros(count), np.zeros(count), PERIOD)
    whole = run_truth(
        joint, muscles, excitation, sensors, np.random.default_rng(0), fixed_commands=commands
    )
    plant = RunningTruth(
        joint,
        muscles,
        Sensors(pressure_noise=0.0, position_noise=0.0, command_step=1e-12),
        np.random.default_rng(0),
        period=PERIOD,
        count=count,
        pressure=2e5,
    )
    for pair in commands:
        plant.advance((pair[0], pair[1]))
    assert np.ptp(whole.true_position) > 0.01
    assert np.abs(plant.truth[:, 2] - whole.true_position).max() < 1e-8
    assert np.abs(plant.truth[:, :2] - whole.true_pressures).max() < 1e-2


@pytest.mark.parametrize("effect", ["nothing", "braid_extensibility", "cable_compliance"])
def test_the_plant_begins_at_rest_with_the_pressures_that_were_asked_for(rough, effect):
    """What stretches has stretched: else the pressures jump at first, as no valve makes them."""
    joint, muscles = rough.hidden(effect)
    sensors = Sensors(pressure_noise=0.0, position_noise=0.0)
    plant = RunningTruth(
        joint, muscles, sensors, np.random.default_rng(0), period=PERIOD, count=2, pressure=2e5
    )
    plant.advance((0.0, 0.0))
    plant.advance((0.0, 0.0))
    assert np.abs(plant.truth[1, :2] - 2e5).max() < 100.0


@pytest.mark.long(
    "test_known_effects holds the compensation of both effects on the plant of the suite"
)
@pytest.mark.parametrize("effect", ["braid_extensibility", "cable_compliance"])
def test_gas_in_parts_that_stretch_is_known_to_the_pressure_loops(rough, effect):
    """A rig file that names the effect is as good as one without it on a rig without it."""
    joint, muscles = rough.hidden(effect)
    truth, rig = muscles[0], load_rig(ELBOW)
    threads = truth.thread_length / (2.0 * math.pi * truth.turns**2) * truth.thread_compliance
    compliance = threads if effect == "braid_extensibility" else truth.cable_compliance
    for muscle in rig.muscles:
        rig = rig.with_muscle(replace(muscle, effects={effect: {"compliance": compliance}}))
    for adaptation in (False, True):
        told = Controller(rig, TOLD.replace(adaptation=adaptation), rough.designs)
        for points in rough.motions.values():
            told.forget_adaptation()
            assert play(told, joint, muscles, points, 6)[0].rms < 3e-4


def test_every_effect_of_the_table_is_hidden_and_changes_the_rig(rough):
    rig = true_rig(load_rig(ELBOW))
    assert CLEAN.applied(*rig) == rig
    assert all(size.applied(*rig) != rig for size in map(size_of, KNOWN))


@pytest.mark.parametrize("seed", [5, 31])  # a slow first stroke, and a fast one
@pytest.mark.parametrize("effect", ["position_offset", "pressure_gain"])
def test_a_false_zero_or_gain_of_a_sensor_is_not_learnt_as_another_torque(effect, seed):
    compared = RoughControl(load_rig(ELBOW), TOLD, seed, plays=1, compares=True)
    assert [result.harm() for result in compared.run(effect, None, 0)] == [[], []]


def test_the_controller_tracks_the_independent_plant_that_is_its_rig_file(rough):
    results = rough.run("nothing", None, 0)
    assert [result.motion for result in results] == ["arm", "chirp"]
    for result in results:
        assert result.controller.rms < 2e-3
        assert result.controller.clipped == 0.0
        assert result.problems() == []
        assert math.isnan(result.ratio)


def test_what_is_learnt_takes_the_place_of_the_integral_without_a_push(rough):
    """An integral that gives it up comes later than what is learnt, by the pressure loops' lag."""
    rough.controller.forget_adaptation()
    played, _ = play(rough.controller, *rough.hidden("hysteresis"), rough.motions["arm"], 5)
    assert played.activity < 16.0  # strokes/s, 22 with a push at each step of what is learnt


@pytest.mark.parametrize("effect", ["viscous_friction", "end_caps"])
def test_a_torque_whose_law_is_among_the_functions_is_learnt_in_the_first_stroke(rough, effect):
    """The data count from the first samples on: 0.7 and 0.8 mrad where they had to wait."""
    rough.controller.forget_adaptation()
    played, _ = play(rough.controller, *rough.hidden(effect), rough.motions["arm"], 5)
    assert played.rms < 0.6e-3


@pytest.mark.parametrize(
    ("first", "last", "harmed"),
    [(0.63, 0.17, 1), (0.29, 0.29, 0), (0.17, 0.32, 1), (4.1, 4.0, 0), (4.3, 4.3, 2)],
)
def test_what_is_worse_than_without_adaptation_is_counted(first, last, harmed):
    """Neither 5 % of a large error nor 0.1 mrad of a small one is harm."""
    without = 0.2 if first < 1.0 else 4.0  # mrad
    mine, later, plain = (PlayedRun(1e-3 * rms, 0.0, 0.0, 10.0) for rms in (first, last, without))
    result = RoughResult("payload", "arm", later, mine, unadapted=(plain, plain))
    assert len(result.harm()) == harmed
    assert len(result.problems()) == harmed


@pytest.mark.long(BASELINE)
def test_a_fitted_feedforward_serves_the_pid_on_the_rig_that_it_was_fitted_to(rough):
    """The fit is what makes the baseline a fair one, on a rig that is not its rig file."""
    joint, muscles = rough.hidden("payload")
    bench = TuningBench(rough.rig, joint, muscles, rough.motions, 5, rough.designs)
    first = bench.first()
    before = bench.play(first)
    after = bench.play(bench.fitted(first, before))
    # in the chirp, the gains of the rig file are near the end of their stability with this load
    assert after["arm"][0].rms < 0.95 * before["arm"][0].rms


@pytest.mark.long(BASELINE)
def test_the_baseline_is_tuned_where_the_gains_of_the_rig_file_swing(rough):
    """A search that begins among gains that swing stays there, and is easily beaten."""
    joint, muscles = rough.hidden("position_delay")
    bench = TuningBench(rough.rig, joint, muscles, {"arm": rough.motions["arm"]}, 5, rough.designs)
    first = bench.play(bench.first())["arm"][0]
    tuned = bench.play(tune(bench, 10, pressure_loops=False))["arm"][0]
    assert not tuned.cycles
    assert not tuned.stopped
    assert tuned.rms < 0.3 * first.rms


def test_gains_that_were_tuned_with_other_code_are_searched_again(rough, monkeypatch):
    joint, muscles = rough.hidden("payload")
    before = rough._key(joint, muscles, 30)
    assert rough._key(joint, muscles, 30) == before
    monkeypatch.setattr("pam_check.control.rough_control.code_version", lambda: "another")
    assert rough._key(joint, muscles, 30) != before


def test_a_loop_that_oscillates_is_reported_as_a_limit_cycle(rough):
    joint, muscles = rough.hidden("command_delay")
    reach = [TrajectoryPoint(0.4, [0.3])]
    bench = TuningBench(rough.rig, joint, muscles, {"reach": reach}, 5, rough.designs)
    wild, _ = bench.play(bench.scaled(bench.first(), 10.0))["reach"]
    assert wild.cycles
    calm, _ = play(rough.controller, *true_rig(rough.rig), reach, 5)
    assert not calm.cycles


def test_the_command_prints_one_result_per_effect_and_motion(capsys):
    assert main(["rough-control", "--effects", "nothing", "--tries", "0", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [(r["effect"], r["motion"]) for r in document["results"]] == [
        ("nothing", "arm"),
        ("nothing", "chirp"),
    ]


def test_an_encoder_with_a_wrong_zero_does_not_begin_a_motion_with_a_jump(rough):
    """The joint goes to the start first: else the jump is taken for an error of the controller."""
    for result in rough.run("position_offset", None, 0):
        assert result.controller.softened == ""
        assert result.controller.rms < 2e-3


def test_an_unknown_effect_is_one_line_and_exit_code_2(capsys):
    assert main(["rough-control", "--effects", "gremlins"]) == 2
    assert "--effects gremlins" in capsys.readouterr().err
    assert main(["learning", "--effects", "payload+gremlins"]) == 2
    assert "--effects payload+gremlins: gremlins is unknown" in capsys.readouterr().err


def test_a_hidden_tube_does_not_make_the_valves_chatter(rough):
    """The sensor at the valve sees the tube alone, whose pressure changes ten times as fast."""
    plain = RoughControl(rough.rig, TOLD.replace(adaptation=False), 5)
    for result in plain.run("tube_restriction", None, 0):
        assert result.controller.activity < 20.0  # strokes/s; a clean rig has 8
        assert result.controller.clipped < 0.01


@pytest.mark.long("test_adaptation finds a tube, and a named one serves the controller here")
def test_the_pressure_behind_a_hidden_tube_is_found_and_controlled(rough):
    """Of the error that the sensor before the tube causes, a third is left, with calm valves."""
    plain, adapting = (
        {r.motion: r.controller for r in control.run("tube_restriction", None, 0)}
        for control in (
            RoughControl(rough.rig, TOLD.replace(adaptation=False), 5),
            RoughControl(rough.rig, TOLD.replace(adaptation=True), 5, plays=2),
        )
    )
    for motion, played in adapting.items():
        assert played.rms < plain[motion].rms / 3.0
        assert played.activity < 12.0
        assert not played.cycles
    assert adapting["arm"].clipped < 0.01


HELD = [TrajectoryPoint(0.5, [0.05], [0.0], [0.0])]


@pytest.mark.long(
    "depends on noise, so that it takes four plays; test_loop_guard holds what an oscillation is"
)
def test_what_a_tube_causes_until_it_is_found_is_not_taken_for_a_loop_that_oscillates(rough):
    """With soft gains, which learn nothing, the tube would never be found. It depends on noise."""
    joint, muscles = rough.hidden("tube_restriction")
    for noise in (1, 2, 3, 4):
        rough.controller.forget_adaptation()
        played, _ = play(rough.controller, joint, muscles, HELD, noise)
        assert (played.softened, played.stopped) == ("", "")
        assert all(loop.behind_tube for loop in rough.controller.channels[0].loops)


@pytest.mark.sampled("a tube or a lag", cases=1)
@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("tube_restriction", {"conductance": 3e-9, "volume": 6e-6}),
        ("pressure_lag", {"time_constant": 0.026}),
    ],
)
def test_a_named_tube_or_lag_serves_a_controller_that_learns_nothing(rough, effect, values):
    told = rough.rig
    for muscle in told.muscles:
        told = told.with_muscle(replace(muscle, effects={effect: values}))
    settings = TOLD.replace(adaptation=False)
    joint, muscles = rough.hidden(effect)
    before, after = (
        play(
            Controller(rig, settings, rough.designs),
            joint,
            muscles,
            rough.motions["arm"],
            1,
        )[0].rms
        for rig in (rough.rig, told)
    )
    assert after < 0.5 * before


@pytest.mark.sampled("one of the three delays", cases=1)
@pytest.mark.parametrize("effect", ["command_delay", "pressure_lag", "position_delay"])
def test_a_hidden_delay_is_no_limit_cycle(rough, effect):
    for result in rough.run(effect, None, 0):
        assert not result.controller.cycles
        assert result.controller.softened == ""


@pytest.mark.sampled("one of the four effects", cases=1)
@pytest.mark.parametrize("effect", ["hysteresis", "payload", "coulomb_friction", "pressure_lag"])
def test_the_disturbance_observer_serves_on_the_independent_plant(rough, effect):
    alone = TOLD.replace(adaptation=False)  # what is learnt would take the observer's share
    plain, observing = (
        RoughControl(rough.rig, settings, 5) for settings in (alone, alone.replace(observer=True))
    )
    for without, observed in zip(
        plain.run(effect, None, 0), observing.run(effect, None, 0), strict=True
    ):
        assert observed.controller.rms < 0.75 * without.controller.rms
        assert not observed.controller.stopped


def _telling_friction(rough):
    """A controller whose rig file names about the friction that is hidden as stribeck_friction."""
    named = {"static_torque": 0.84, "torque": 0.45, "speed": 0.105, "presliding_angle": 1.75e-3}
    joint = replace(rough.rig.joints[0], effects={"stribeck_friction": named})
    settings = TOLD.replace(adaptation=True)
    return Controller(rough.rig.with_joint(joint), settings, rough.designs)


@pytest.mark.long(
    "test_known_effects holds what remains of named friction on the plant of the suite"
)
def test_friction_that_falls_with_speed_is_halved_when_the_rig_file_names_it(rough):
    """Protects reversals, ends of motions and slow motion: without any of its parts it is not."""
    joint, muscles = rough.hidden("stribeck_friction")
    before = Controller(rough.rig, TOLD.replace(adaptation=True), rough.designs)
    after = _telling_friction(rough)
    for points in rough.motions.values():
        errors = []
        for law in (before, after):
            law.forget_adaptation()
            played, _ = play(law, joint, muscles, points, 5)
            assert not played.cycles
            errors.append(played.rms)
        assert errors[1] < 0.5 * errors[0]


@pytest.mark.sampled("with or without a delay", cases=1)
@pytest.mark.parametrize("late", [0.0, 0.015])
def test_friction_that_the_joint_does_not_have_is_no_limit_cycle(rough, late):
    """What is given back with the measured speed is feedback: it must not oscillate."""
    joint, muscles = rough.hidden("nothing")
    muscles = tuple(muscle._replace(command_delay=late) for muscle in muscles)
    law = _telling_friction(rough)
    for points in rough.motions.values():
        law.forget_adaptation()
        played, _ = play(law, joint, muscles, points, 5)
        assert not played.cycles
        assert not played.softened


@pytest.mark.sampled("one of the three moments", cases=1)
@pytest.mark.parametrize(
    ("seed", "put_on"),  # s in the reach
    [(1, 0.15), (2, 0.3), (3, 0.45)],
)
def test_a_payload_that_is_put_on_in_mid_motion_is_settled_within_a_second(rough, seed, put_on):
    """Later reaches overshoot by less than 5 % of their length."""
    adapting = RoughControl(load_rig(ELBOW), TOLD.replace(adaptation=True), seed)
    controller, clean = adapting.controller, rough.hidden("nothing")
    reaches = [0.5, -0.4, 0.5, -0.4, 0.5]  # rad, one every 2 s, each within 0.6 s
    count = round((1.5 + 2.0 * len(reaches)) / PERIOD)
    plant = RunningTruth(
        *clean, Sensors(), np.random.default_rng(seed), period=PERIOD, count=count, pressure=2e5
    )
    commands = (0.0, 0.0)
    for k in range(count):
        now, number = k * PERIOD, round((k * PERIOD - 1.5) / 2.0, 6)
        shown = plant.advance(commands)
        if number >= 0.0 and number == int(number):
            reach = [TrajectoryPoint(0.6, [reaches[int(number)]], [0.0], [0.0])]
            controller.references.follow(["elbow"], reach, start=None, now=now)
        if k == round((1.5 + put_on) / PERIOD):
            plant.becomes(*rough.hidden("payload"))
        output = controller.step(now, Measurement([shown[2]], [shown[0], shown[1]], now, now))
        assert output.commands is not None, output.reason
        commands = (output.commands[0], output.commands[1])
    position = plant.truth[:, 2]

    def between(start: float, end: float) -> np.ndarray:
        return position[round(start / PERIOD) : round(end / PERIOD)]

    assert np.abs(between(2.5 + put_on, 3.5) - 0.5).max() < 0.01
    for index in range(1, len(reaches)):
        length = reaches[index] - reaches[index - 1]
        beyond = (between(1.5 + 2.0 * index, 3.5 + 2.0 * index) - reaches[index]) / length
        assert beyond.max() < 0.05


STROKES = (0.5, -0.4, 0.5, -0.4, 0.5, -0.4, 0.5, -0.4)  # rad, one each second, within 0.7 s
CHANGED = 5.2  # s after the first stroke began


def _errors_after_a_change(control, before, after, seed):
    """RMS error [rad] from the second second after a rig has become another one in mid motion."""
    controller = control.controller
    controller.forget_adaptation()
    controller.drop_commands()
    count = round((1.5 + len(STROKES)) / PERIOD)
    plant = RunningTruth(
        *control.hidden(before),
        Sensors(),
        np.random.default_rng(seed),
        period=PERIOD,
        count=count,
        pressure=2e5,
    )
    commands, errors = (0.0, 0.0), []
    begins = {round((1.5 + index) / PERIOD): to for index, to in enumerate(STROKES)}
    for k in range(count):
        now = k * PERIOD
        shown = plant.advance(commands)
        if k in begins:
            stroke = [TrajectoryPoint(0.7, [begins[k]], [0.0], [0.0])]
            controller.references.follow(["elbow"], stroke, start=None, now=now)
        if k == round((1.5 + CHANGED) / PERIOD):
            plant.becomes(*control.hidden(after))
        output = controller.step(now, Measurement([shown[2]], [shown[0], shown[1]], now, now))
        assert output.commands is not None, output.reason
        commands = (output.commands[0], output.commands[1])
        reference = controller.references.sample("elbow", now).position
        errors.append(reference - plant.truth[k, 2])
    return float(np.sqrt(np.mean(np.square(errors[round((2.5 + CHANGED) / PERIOD) :]))))


@pytest.mark.sampled("a load and an effect of the valves", cases=2)
@pytest.mark.parametrize(
    ("gone", "left"),  # rad; before there was a comparison, 5, 12, 22, 9, 4 and 8 mrad were left
    [
        ("payload", 0.6e-3),
        ("valve_dead_zone", 1.4e-3),
        ("hysteresis", 4e-3),
        ("stribeck_friction", 2e-3),
        ("coulomb_friction", 2e-3),
        ("supply_droop", 5e-3),
    ],
)
def test_what_was_learnt_is_taken_back_when_its_cause_is_gone(rough, gone, left):
    adapting = RoughControl(rough.rig, TOLD.replace(adaptation=True), 1)
    assert _errors_after_a_change(adapting, gone, "nothing", 1) < left


@pytest.mark.parametrize("seed", [1, 12, 13])
def test_a_delay_with_hysteresis_lowers_the_gains_and_stops_nothing(rough, seed):
    """It was answered by a stop in some noise, or by soft gains that left 60 mrad."""
    for result in RoughControl(rough.rig, TOLD, seed).run("hysteresis, commands 19 ms", None, 0):
        assert not result.controller.stopped
        assert result.controller.swings
        assert result.controller.rms < 0.02
