"""The commands that fit: one vocabulary of geometry, advice, and a section for the rig file."""

import math
import re

import pytest
import yaml

from pam_model.__main__ import main
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.rig import rig_from_parameters
from pam_model.rig.from_datasheet import BraidFromDatasheet
from support.rigs import ELBOW

IN_ALL_WORDS = (
    ["--rest-length", "0.2", "--size", "DMSP-20"],
    ["--length", "0.2", "--diameter", "0.02", "--angle", "{angle}"],
    ["--rest-length", "0.2", "--thread-length", "{thread}", "--turns", "{turns}"],
)


@pytest.mark.parametrize("command", ["braid", "fit", "compare"])
def test_a_geometry_has_the_same_words_in_every_command(command, tmp_path, capsys) -> None:
    """There were three vocabularies in three commands."""
    braid = BraidFromDatasheet.of_size("DMSP-20", 0.2)
    numbers = {
        "angle": f"{math.degrees(math.acos(braid.rest_length / braid.thread_length)):.9g}",
        "thread": f"{braid.thread_length:.9g}",
        "turns": f"{braid.turns:.9g}",
    }
    points = tmp_path / "points.csv"
    rows = [
        f"{p},{0.0005 * p - 2000 * c},{0.2 * (1 - c)},{k % 2}"
        for k, (p, c) in enumerate((p, c) for p in (2e5, 3e5, 4e5) for c in (0.0, 0.05, 0.1))
    ]
    points.write_text("\n".join(["pressure,force,length,block", *rows]))
    words = {
        "braid": ["braid"],
        "fit": ["fit", "tondu_lopez", str(points), "--starts", "1"],
        "compare": ["compare", str(points), "--models", "tondu_lopez", "--starts", "1"],
    }[command]
    said = []
    for geometry in IN_ALL_WORDS:
        assert main([*words, *(text.format(**numbers) for text in geometry)]) == 0
        said.append(capsys.readouterr().out)
        if command != "compare":
            assert "turns 2" in said[-1] or "turns 1" in said[-1]
            assert f"diameter 20 mm, angle {float(numbers['angle']):.4g} deg at rest" in said[-1]
    if command == "compare":
        assert said[0] == said[1] == said[2]


def test_a_fit_says_what_to_state_and_a_stated_number_is_kept(tmp_path, capsys) -> None:
    points = tmp_path / "points.csv"
    model = create_force_model("tondu_lopez", MuscleGeometry(0.25, 2.0, 0.235), {"k": 1.2})
    rows = [
        f"{p},{model.force(p, length)},{length},{k % 2}"
        for k, (p, length) in enumerate(
            (p, length) for p in (1e5, 2e5, 3e5) for length in (0.18, 0.2, 0.21, 0.22)
        )
    ]
    points.write_text("\n".join(["pressure,force,length,block", *rows]))
    assert main(["fit", "tondu_lopez", str(points), "--starts", "1"]) == 0
    said = capsys.readouterr().out
    told = [
        line for line in said.splitlines() if "advice:" in line and "distinguished from" in line
    ]
    assert told and all("state one of them: " in line for line in told)
    assert any("--rest-length, with a tape measure" in line for line in told)
    assert main(["fit", "tondu_lopez", str(points), "--rest-length", "0.235"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"rest_length +0\.235 m +given", said)
    assert re.search(r"k +1\.2 ", said)
    assert "rest_length cannot" not in said
    given = ["--rest-length", "0.235", "--diameter", "0.013575"]
    assert main(["fit", "tondu_lopez", str(points), *given]) == 0
    assert "advice:" not in capsys.readouterr().out


def test_a_fit_prints_a_section_that_a_rig_file_takes(tmp_path, capsys) -> None:
    points = tmp_path / "points.csv"
    model = create_force_model("tondu_lopez", MuscleGeometry(0.25, 2.0, 0.235), {"k": 1.2})
    rows = [f"{p},{model.force(p, length)},{length}" for p in (1e5, 3e5) for length in (0.18, 0.22)]
    points.write_text("\n".join(["pressure,force,length", *rows]))
    given = ["--thread-length", "0.25", "--turns", "2", "--rest-length", "0.235"]
    assert main(["fit", "tondu_lopez", str(points), *given, "--section", "flexor"]) == 0
    text = capsys.readouterr().out.partition("    flexor:")[2]
    section = yaml.safe_load("    flexor:" + text)["flexor"]
    assert section["model"] == "tondu_lopez"
    assert section["model_parameters"]["k"] == pytest.approx(1.2, abs=1e-6)
    keys = yaml.safe_load(ELBOW.read_text())["/**"]["ros__parameters"]
    keys["elbow_flexor"] |= section | {"neutral_length": 0.2}
    assert rig_from_parameters(keys).muscle("elbow_flexor").model == "tondu_lopez"
