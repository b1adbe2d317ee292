"""List, show and design."""

import json
import math
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.__main__ import main
from pam_model.catalogue.catalogue import FAMILIES, catalogue
from pam_model.catalogue.default_model import default_model
from pam_model.errors import DomainError, PamError
from pam_model.identify.design import design, jam_angle
from pam_model.muscles.braid import NEUTRAL_ANGLE
from pam_model.muscles.force_model import MuscleGeometry, create_force_model, registered_models
from pam_model.muscles.models.gaylord import Gaylord

ROWS = catalogue()
MODELS = registered_models()


def test_catalogue_is_complete() -> None:
    keys = [row.key for row in ROWS]
    assert len(set(keys)) == len(keys)
    named = [name for row in ROWS for name in row.models]
    assert sorted(named) == sorted(MODELS)  # each registered model in one row, and no other name
    for row in ROWS:
        assert row.family in FAMILIES
        assert row.models or row.objects, row.key
        for text in (row.equations, row.status, row.domain, row.use, row.avoid):
            assert text, row.key
        for path in row.objects:
            module, _, name = path.partition(":")
            assert hasattr(import_module(module), name), path


def test_list_names_every_model(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    shown = capsys.readouterr().out
    for name in MODELS:
        assert name in shown
    assert "planned" not in shown


def test_show_writes_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "muscle.svg"
    assert main(["show", "tondu_lopez", "--set", "k=1.3", "--output", str(out)]) == 0
    assert out.read_text(encoding="utf-8").startswith("<?xml")
    assert main(["show", "sleeve", "--output", str(out)]) == 0  # a row with one model
    assert main(["show", "bouc_wen"]) == 0
    assert "code: pam_model.atlas.losses.bouc_wen:BoucWen" in capsys.readouterr().out
    assert main(["show", "bouc_wen", "--output", str(out)]) == 2
    assert "docs/models.md has its picture" in capsys.readouterr().err
    assert main(["show", "nothing", "--output", str(out)]) == 2
    assert main(["show", "gaylord", "--turns", "2", "--output", str(out)]) == 2
    assert main(["show", "gaylord", "--output", str(tmp_path / "muscle.xyz")]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 3
    assert all(line.startswith("error: ") for line in errors)


def test_fit_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = create_force_model("tondu_lopez", MuscleGeometry(0.25, 2.0, 0.235), {"k": 1.25})
    lines = ["pressure,force,length,block"]
    for i in range(24):
        pressure, length = 1e5 * (1 + i % 4), 0.18 + 0.002 * i
        lines.append(f"{pressure},{model.force(pressure, length)},{length},{i // 12}")
    points = tmp_path / "points.csv"
    points.write_text("\n".join(lines), encoding="utf-8")
    muscle = ["--thread-length", "0.25", "--turns", "2", "--rest-length", "0.235"]
    plot = tmp_path / "fit.png"
    command = ["fit", "tondu_lopez", str(points), *muscle]
    assert main(command) == 0
    assert "k                                  1.25" in capsys.readouterr().out
    assert main([*command, "--json", "--plot", str(plot)]) == 0
    assert plot.stat().st_size > 5000
    (saved,) = json.loads(capsys.readouterr().out)
    assert saved["constants"]["k"] == pytest.approx(1.25)
    assert main(["fit", "colbrunn", str(points), *muscle]) == 2


@given(
    force=st.floats(1.0, 2000.0),
    stroke=st.floats(0.005, 0.3),
    pressure=st.floats(1e5, 8e5),
    contraction=st.floats(0.02, 0.24),
)
def test_design_does_what_was_asked(
    force: float, stroke: float, pressure: float, contraction: float
) -> None:
    made = design(force, stroke, pressure, contraction=contraction, strands=48)
    muscle = Gaylord(made.thread_length, made.turns)
    assert made.rest_length - made.end_length == pytest.approx(stroke, rel=1e-9)
    assert made.end_force == pytest.approx(muscle.force(pressure, made.end_length), rel=1e-9)
    assert made.end_force >= force * (1.0 - 1e-9)
    assert made.rest_force > made.end_force
    assert made.end_stiffness == pytest.approx(muscle.stiffness(pressure, made.end_length))
    assert made.gas_volume == pytest.approx(muscle.volume(made.end_length))
    assert made.jam_angle < made.rest_angle < made.end_angle < NEUTRAL_ANGLE
    assert made.rest_length < made.longest_length
    strand_gap = made.diameter_90 * math.pi / 48.0 * math.sin(2.0 * made.jam_angle)
    assert strand_gap == pytest.approx(0.3e-3, rel=1e-9)


@given(strands=st.integers(10, 200), width=st.floats(1e-4, 4e-4))
def test_more_and_wider_strands_jam_earlier(strands: int, width: float) -> None:
    assert jam_angle(width, strands + 1, 0.04) > jam_angle(width, strands, 0.04)
    assert jam_angle(1.1 * width, strands, 0.04) > jam_angle(width, strands, 0.04)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"contraction": 0.45}, "free contraction"),
        ({"largest_length": 0.05}, "free contraction"),
        ({"largest_diameter": 0.01}, "largest_diameter"),
        ({"strand_strength": 1.0}, "strand_strength"),
        ({"strands": 0}, "strands"),
        ({"contraction": 0.1, "largest_length": 0.1}, "rest length"),
    ],
)
def test_design_says_what_limits_it(options: dict[str, float], message: str) -> None:
    with pytest.raises(DomainError, match=message):
        design(300.0, 0.04, 3e5, **options)  # type: ignore[arg-type]


def test_many_strands_limit_a_thin_muscle() -> None:
    assert "jam" in design(20.0, 0.04, 4e5, strands=200, strand_width=0.4e-3).limited_by


def test_list_tells_names_for_a_rig_file_from_other_rows(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    said = {}
    for row in catalogue():
        at = next(i for i, line in enumerate(lines) if line.split()[:1] == [row.key])
        said[row.key] = lines[at + 2].strip()
        assert said[row.key].startswith("in a rig file: ")
    assert said["mooney_rivlin"] == "in a rig file: braid_bladder"
    assert "not a length-force model" in said["fill_time"]
    for row in catalogue():
        for name in row.models:
            assert name in said[row.key]
            create_force_model(name, default_model(name)[1])  # what the list offers is taken


def test_a_row_named_instead_of_its_model_is_refused_with_the_model() -> None:
    geometry = default_model("gaylord")[1]
    for row in catalogue():
        if row.models and row.key not in row.models:
            with pytest.raises(PamError, match=f"rig file is {row.models[0]}"):
                create_force_model(row.key, geometry)
