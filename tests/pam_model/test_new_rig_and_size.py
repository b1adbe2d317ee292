"""New rig files from a few numbers, and a joint sized for a task."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pytest

from pam_driver.__main__ import main as driver_main
from pam_model.__main__ import main
from pam_model.command_line import DONE, MISTAKE
from pam_model.commands.new_rig import QUESTIONS, ask
from pam_model.gas.flow import mass_flow
from pam_model.joints.joint_statics import JointStatics
from pam_model.muscle_sizes import SIZES
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant
from pam_model.rig import load_rig
from pam_model.rig.from_datasheet import BraidFromDatasheet
from pam_model.unit_hints import read_with_unit


def test_a_new_rig_is_commented_and_check_rig_accepts_it(tmp_path, capsys):
    path = tmp_path / "arm.yaml"
    options = ["--joints", "shoulder, elbow", "--pulley-radius", "0.018", "--defaults"]
    assert main(["new-rig", str(path), *options]) == DONE
    rig = load_rig(path)
    assert rig.joint_names == ("shoulder", "elbow")
    assert rig.joints[1].pulley_radius == 0.018
    lines = [line for line in path.read_text().splitlines() if line.startswith("      ")]
    numbers = [line for line in lines if any(digit in line for digit in "0123456789")]
    told = [line for line in numbers if "#" in line]
    assert len(told) > 0.7 * len(numbers), "most numbers say what they are"
    capsys.readouterr()
    written = path.read_text()
    assert main(["new-rig", str(path), "--defaults"]) == MISTAKE
    assert path.read_text() == written, "a rig file is the work of its owner"
    assert "exists already" in capsys.readouterr().err
    assert driver_main(["check-rig", str(path), "--check"]) == DONE
    assert "can use this rig" in capsys.readouterr().out


def test_an_arm_with_more_boards_than_a_bus_carries_has_several_buses(tmp_path, capsys):
    path = tmp_path / "arm.yaml"
    joints = ",".join(f"j{k}" for k in range(1, 8))
    assert main(["new-rig", str(path), "--joints", joints, "--defaults"]) == DONE
    assert driver_main(["check-rig", str(path), "--check"]) != DONE, "7 boards on one bus"
    path.unlink()
    options = ["--joints", joints, "--buses", "can0,can1", "--defaults"]
    assert main(["new-rig", str(path), *options]) == DONE
    capsys.readouterr()
    assert driver_main(["check-rig", str(path), "--check"]) == DONE
    said = capsys.readouterr().out
    assert "can0" in said and "can1" in said
    path.unlink()
    options = ["--joints", "one", "--buses", "can0,can1", "--defaults"]
    assert main(["new-rig", str(path), *options]) == MISTAKE


def test_a_range_that_the_muscles_cannot_move_is_refused_with_the_pulley_that_fits(
    tmp_path, capsys
):
    path = tmp_path / "arm.yaml"
    assert main(["new-rig", str(path), "--pulley-radius", "0.2", "--defaults"]) == MISTAKE
    said = capsys.readouterr().err
    assert said.startswith("error: pulley_radius = 0.2 m") and said.count("\n") == 1
    assert not path.exists()
    most = said.split("pulley of ")[1].split(" m")[0]
    assert main(["new-rig", str(path), "--pulley-radius", most, "--defaults"]) == DONE


@pytest.mark.parametrize("names", ["Elbow", "a,a", "1st", "a b"])
def test_names_that_ros_does_not_take_are_refused(tmp_path, capsys, names):
    assert main(["new-rig", str(tmp_path / "arm.yaml"), "--joints", names]) == MISTAKE
    assert "expected" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_question_is_asked_again_until_the_answer_can_be_used(monkeypatch, capsys):
    radius = next(question for question in QUESTIONS if question.name == "pulley_radius")
    monkeypatch.setattr("sys.stdin", Terminal("thick\n-1\n0.03\n\n"))
    assert ask(radius, "0.02") == 0.03
    said = capsys.readouterr()
    assert said.err.count("radius of the pulley [m] [0.02]: ") == 3
    assert "thick: expected a number in m above 0" in said.err
    assert said.out == ""
    assert ask(radius, "0.02") == 0.02  # Enter


def test_answers_come_from_a_pipe_as_well(monkeypatch, capsys, tmp_path):
    path = tmp_path / "arm.yaml"
    answers = {question.name: "" for question in QUESTIONS} | {"joints": "wrist", "inertia": "0.5"}
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{one}\n" for one in answers.values())))
    assert main(["new-rig", str(path)]) == DONE
    assert load_rig(path).joint("wrist").inertia == 0.5


@pytest.mark.parametrize(
    ("piped", "told"),
    [("", "--joints"), ("arm\n\n", "--diameter"), ("arm\n\nthick\n0.01\n", "thick")],
)
def test_answers_of_a_pipe_that_do_not_suffice_are_an_error(
    piped, told, monkeypatch, capsys, tmp_path
):
    monkeypatch.setattr("sys.stdin", io.StringIO(piped))
    assert main(["new-rig", str(tmp_path / "arm.yaml")]) == MISTAKE
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("error: ") and told in line
    assert not (tmp_path / "arm.yaml").exists()


@pytest.mark.parametrize(
    "options",
    [
        ["new-rig", "RIG", "--defaults"],
        ["new-rig", "RIG", "--defaults", "--max-pressure", "3bar"],
        ["new-rig", "RIG", "--defaults", "--valve", "pressure_regulator"],
        *(["new-rig", "RIG", "--defaults", "--size", name] for name in SIZES),
        *(
            ["size", *task.split(), "--write-rig", "RIG"]
            for task in (
                "--torque 5 --range 1 --speed 3 --pressure 5e5",
                "--torque 20 --range 0.7 --speed 2 --pressure 6e5",
                "--torque 1 --range 1.2 --speed 5 --pressure 3bar",
            )
        ),
    ],
)
def test_a_new_rig_draws_no_caution(options, tmp_path, capsys):
    path = str(tmp_path / "rig.yaml")
    assert main([path if word == "RIG" else word for word in options]) == DONE
    assert driver_main(["check-rig", path, "--check"]) == DONE
    assert "CAUTION" not in "".join(capsys.readouterr())


@pytest.mark.parametrize("name", ["DMSP-20", "dmsp-20", "DMSP20", "mas_20", "DMSP-20-250N-RM-CM"])
def test_a_size_is_known_as_its_maker_spells_it(name, tmp_path):
    path = tmp_path / "rig.yaml"
    assert main(["new-rig", str(path), "--size", name, "--length", "0.3", "--defaults"]) == DONE
    assert load_rig(path).muscles[0].rest_length == 0.3
    made = BraidFromDatasheet.of_size("DMSP-20", 0.3)
    assert load_rig(path).muscles[0].turns == pytest.approx(made.turns, rel=1e-5)
    assert main(["braid", "--size", name, "--length", "0.3"]) == DONE


def test_a_size_and_a_diameter_are_refused_together(tmp_path, capsys):
    words = ["new-rig", str(tmp_path / "rig.yaml"), "--size", "DMSP-20", "--diameter", "0.02"]
    assert main(words) == MISTAKE
    assert "--size states diameter and angle" in capsys.readouterr().err


def test_threads_and_turns_are_an_answer_as_well(tmp_path, capsys):
    """The words of the other commands: rest length, thread length and turns."""
    place = tmp_path / "rig.yaml"
    words = ["new-rig", str(place), "--defaults", "--rest-length", "0.25"]
    assert main([*words, "--thread-length", "0.2758", "--turns", "1.856"]) == DONE
    muscle = load_rig(place).muscles[0]
    assert (muscle.thread_length, muscle.turns, muscle.rest_length) == (0.2758, 1.856, 0.25)
    for threads, told in (
        (["--turns", "1.8"], "--thread-length and --turns state both"),
        (["--thread-length", "0.2", "--turns", "1.8"], "expected more than the rest length"),
        (["--thread-length", "0.3", "--turns", "1.8", "--size", "DMSP-20"], "--size states"),
    ):
        again = ["new-rig", str(tmp_path / "other.yaml"), *words[2:], *threads]
        assert main(again) == MISTAKE
        assert told in capsys.readouterr().err


def sized(tmp_path, capsys, *more: str) -> dict:
    rig, plot = tmp_path / "sized.yaml", tmp_path / "size.png"
    task = ["--torque", "5", "--range", "0.9", "--speed", "3", "--pressure", "5e5"]
    files = ["--write-rig", str(rig), "--plot", str(plot)]
    assert main(["size", *task, *files, "--json", *more]) == DONE
    assert plot.stat().st_size > 5_000
    return json.loads(capsys.readouterr().out)


def test_a_sized_joint_gives_its_torque_at_every_angle_and_no_more_than_needed(tmp_path, capsys):
    found = sized(tmp_path, capsys)
    rig = load_rig(tmp_path / "sized.yaml")
    joint = JointStatics.from_rig(rig, "joint")
    angles = np.linspace(-0.9, 0.9, 19)
    most = [joint.torque((5e5, 0.0), float(angle)) for angle in angles]
    assert min(most) == pytest.approx(1.3 * 5.0, rel=0.02), "the task and its margin"
    assert found["curves"]["highest_torque"][0] == pytest.approx(most[0])
    assert driver_main(["check-rig", str(tmp_path / "sized.yaml"), "--check"]) == DONE


def test_the_valve_of_a_sized_joint_moves_it_at_the_speed_asked_for(tmp_path, capsys):
    """The plant, which knows nothing of the sizing, crosses the range with the valves open."""
    found = sized(tmp_path, capsys, "--inertia", "0.005")
    rig = load_rig(tmp_path / "sized.yaml")
    plant = Plant(PlantParameters.from_rig(rig))
    for _ in range(1500):  # to the lower end: only the antagonist has air
        position, *_ = plant.step((-1.0, 1.0), 2e-3)
    assert position < -0.8
    times = {}
    for step in range(1500):
        position, *_ = plant.step((1.0, -1.0), 2e-3)
        for mark in (-0.6, 0.6):
            if position > mark:
                times.setdefault(mark, step * 2e-3)
    speed = 1.2 / (times[0.6] - times[-0.6])
    assert speed > 0.7 * 3.0
    half = mass_flow(found["sonic_conductance"], 0.3, 2.5e5 + 101325.0, 101325.0)
    assert half >= 0.99 * found["peak_flow"]


def test_a_task_for_which_no_muscle_can_be_built_is_refused(tmp_path, capsys):
    task = ["--torque", "1e6", "--range", "1", "--speed", "3", "--pressure", "5e5"]
    assert main(["size", *task]) == MISTAKE
    assert "more than 1 m diameter" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.02", "m", 0.02),
        ("20mm", "m", 0.02),
        ("2e1 mm", "m", 0.02),
        ("23deg", "deg", 23.0),
        ("23 deg", "rad", math.radians(23.0)),
        ("0.4rad", "deg", math.degrees(0.4)),
        ("6bar", "Pa", 6e5),
        ("600 kPa", "Pa", 6e5),
        ("-1.5", "N m", -1.5),
        ("-1.5 N m", "N m", -1.5),
    ],
)
def test_a_number_may_be_written_with_its_unit(text, unit, value):
    assert read_with_unit(text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["20furlong", "6bar", "mm", "", "1e", "20mm mm", "2..0mm"])
def test_another_quantity_or_no_number_is_not_read(text):
    assert math.isnan(read_with_unit(text, "m"))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["braid", "--diameter", "20", "--length", "0.3", "--angle", "23"], "mean 20mm"),
        (["braid", "--diameter", "0.02", "--length", "0.3", "--angle", "0.4"], "mean 0.4rad"),
        (["size", "--torque", "5", "--range", "60", "--speed", "3", "--pressure", "5e5"], "60deg"),
        (["size", "--torque", "5", "--range", "1", "--speed", "3", "--pressure", "5"], "5bar"),
    ],
)
def test_a_number_in_another_unit_is_refused_with_what_was_meant(words, told, capsys):
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line
