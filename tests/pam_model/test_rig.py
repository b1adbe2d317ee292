"""Rig files: reading, writing, queries, parameters of nodes, and the shipped files."""

from array import array
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from pam_model.effects import EFFECTS, effect_value
from pam_model.errors import RigError
from pam_model.rig import Encoder, Rig, Valve, load_rig, rig_from_parameters, rig_of_node, save_rig
from pam_model.rig.effects_as_numbers import only_changes_numbers
from pam_model.rig.types import NUMBERS

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
MOTION_LIMITS = ("max_velocity", "max_acceleration", "max_tracking_error", "max_stiffness_rate")


@pytest.fixture
def rig() -> Rig:
    return load_rig(CONFIG / "two_joints.yaml")


@pytest.mark.parametrize("name", ["elbow.yaml", "two_joints.yaml"])
def test_shipped_rig_survives_a_round_trip(name: str, tmp_path: Path) -> None:
    rig = load_rig(CONFIG / name)
    save_rig(rig, tmp_path / "copy.yaml")
    assert load_rig(tmp_path / "copy.yaml") == rig
    assert [path.name for path in tmp_path.iterdir()] == ["copy.yaml"]


def test_order_and_lookups(rig: Rig) -> None:
    assert rig.joint_names == ("shoulder", "elbow")
    assert rig.muscle_names == (
        "shoulder_flexor",
        "shoulder_extensor",
        "elbow_flexor",
        "elbow_extensor",
    )
    assert rig.joint("elbow").antagonist == "elbow_extensor"
    assert rig.joint_of("shoulder_flexor") == rig.joint("shoulder")
    assert rig.joint("shoulder").encoder == Encoder(board=0, channel=0)
    assert rig.muscle("elbow_flexor").valve == Valve(
        "pressure_regulator", 4e-9, 0.3, 0.02, full_scale=6e5
    )
    assert rig.supply_gauge_pressure == 600000.0
    with pytest.raises(KeyError, match="unknown joint 'knee'"):
        rig.joint("knee")


def test_force_model_is_made_once_and_anew_for_a_changed_muscle(rig: Rig) -> None:
    model = rig.force_model("elbow_flexor")
    assert rig.force_model("elbow_flexor") is model
    changed = rig.with_muscle(replace(rig.muscle("elbow_flexor"), turns=2.0))
    assert changed.force_model("elbow_flexor").force(1e5, 0.225) == pytest.approx(
        model.force(1e5, 0.225) * (1.856 / 2.0) ** 2
    )
    assert rig.muscle("elbow_flexor").turns == 1.856


def flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found


def test_dotted_keys_are_the_same_rig(rig: Rig) -> None:
    assert rig_from_parameters(flat(rig.to_parameters())) == rig


def test_the_tolerance_of_lengths_is_optional_and_kept(rig: Rig) -> None:
    assert rig.length_tolerance is None
    assert "length_tolerance" not in rig.to_parameters()
    stated = rig_from_parameters(rig.to_parameters() | {"length_tolerance": 0.005})
    assert stated.length_tolerance == 0.005
    assert rig_from_parameters(stated.to_parameters()) == stated
    with pytest.raises(RigError, match="length_tolerance"):
        rig_from_parameters(rig.to_parameters() | {"length_tolerance": 0.9})


def test_defaults(rig: Rig) -> None:
    tree = rig.to_parameters()
    for key in ("gas", "parameter_tolerance"):
        del tree[key]
    for key in ("viscous_friction", "gravity_torque", "gravity_angle", "encoder"):
        del tree["elbow"][key]
    for key in MOTION_LIMITS:
        del tree["elbow"][key]
    for key in ("wall_thickness", "dead_volume", "max_pressure", "board", "channel"):
        del tree["elbow_flexor"][key]
    del tree["elbow_flexor"]["valve"]["full_scale"]
    rig = rig_from_parameters(tree)
    assert (rig.gas.temperature, rig.gas.polytropic_exponent) == (293.15, 1.0)
    assert rig.muscle("elbow_flexor").max_pressure == 701325.0 - 101325.0
    assert rig.muscle("elbow_flexor").valve.full_scale == 600000.0
    assert rig.muscle("elbow_flexor").board is None
    assert rig.joint("elbow").encoder is None
    assert rig.joint("elbow").gravity_torque == 0.0
    assert [getattr(rig.joint("elbow"), key) for key in MOTION_LIMITS] == [6.0, 200.0, 0.5, 50.0]


def test_motion_limits_are_read_and_saved(rig: Rig, tmp_path: Path) -> None:
    limits = dict(zip(MOTION_LIMITS, (2.5, 30.0, 0.2, 15.0), strict=True))
    save_rig(rig.with_joint(replace(rig.joint("elbow"), **limits)), tmp_path / "rig.yaml")
    elbow = load_rig(tmp_path / "rig.yaml").joint("elbow")
    assert {key: getattr(elbow, key) for key in MOTION_LIMITS} == limits


def test_whole_numbers_and_points_left_out_are_numbers(tmp_path: Path) -> None:
    text = (CONFIG / "elbow.yaml").read_text(encoding="utf-8")
    assert "2.0e-05" in text
    assert "[-1.0, 1.0]" in text
    path = tmp_path / "rig.yaml"
    path.write_text(
        text.replace("2.0e-05", "2e-05").replace("[-1.0, 1.0]", "[-1, 1]"), encoding="utf-8"
    )
    assert load_rig(path) == load_rig(CONFIG / "elbow.yaml")


def test_bench_of_one_muscle(rig: Rig, tmp_path: Path) -> None:
    tree = rig.to_parameters()
    bench = rig_from_parameters(
        {
            "supply_pressure": 701325.0,
            "joints": [],
            "bench_muscles": ["elbow_flexor"],
            "elbow_flexor": tree["elbow_flexor"],
        }
    )
    assert bench.muscle_names == ("elbow_flexor",)
    assert bench.joint_of("elbow_flexor") is None
    save_rig(bench, tmp_path / "bench.yaml")
    assert load_rig(tmp_path / "bench.yaml") == bench


def test_bench_muscles_follow_those_of_joints(rig: Rig) -> None:
    tree = rig.to_parameters()
    tree["bench_muscles"] = ["spare"]
    tree["spare"] = {
        key: value for key, value in tree["elbow_flexor"].items() if key not in {"board", "channel"}
    }
    assert rig_from_parameters(tree).muscle_names == (*rig.muscle_names, "spare")


def test_keys_of_a_node_are_let_through_only_when_named(rig: Rig) -> None:
    tree = rig.to_parameters() | {"rate": 500.0}
    assert rig_from_parameters(tree, other_keys=("rate",)) == rig
    with pytest.raises(RigError, match="rate: unknown key"):
        rig_from_parameters(tree)


def test_every_effect_can_be_written_and_read(rig: Rig, tmp_path: Path) -> None:
    tree = rig.to_parameters()
    places = {"muscle": tree["elbow_flexor"], "joint": tree["elbow"], "rig": tree}
    for name, effect in EFFECTS.items():
        places[effect.scope].setdefault("effects", {})[name] = {
            key: 0.5 * (entry.low + entry.high) for key, entry in effect.parameters.items()
        }
    full = rig_from_parameters(tree)
    save_rig(full, tmp_path / "full.yaml")
    again = load_rig(tmp_path / "full.yaml")
    assert again == full
    found = again.muscle("elbow_flexor").effects, again.joint("elbow").effects, again.effects
    numbers = {name for name, effect in EFFECTS.items() if only_changes_numbers(effect)}
    assert len(EFFECTS) == 27
    assert numbers == {"dead_volume", "payload", "pulley_radius", "valve_lag", "viscous_friction"}
    assert {name for effects in found for name in effects} == set(EFFECTS) - numbers


def test_effects_left_out_are_neutral(rig: Rig) -> None:
    effects = rig.muscle("elbow_flexor").effects
    for name, effect in EFFECTS.items():
        values = {key: effect_value(effects, name, key) for key in effect.parameters}
        assert effect.is_neutral(values)
        for key in effect.magnitudes:
            assert not effect.is_neutral(values | {key: effect.parameters[key].high})


@pytest.mark.parametrize("name", EFFECTS)
def test_neutral_values_lie_within_their_bounds(name: str) -> None:
    for entry in EFFECTS[name].parameters.values():
        assert entry.low <= entry.neutral <= entry.high
        assert entry.low < entry.high


def test_page_names_every_key() -> None:
    page = (ROOT / "docs" / "rig_file.md").read_text(encoding="utf-8")
    keys = [key for section in NUMBERS.values() for key in section]
    keys += [key for effect in EFFECTS.values() for key in (effect.name, *effect.parameters)]
    assert [key for key in keys if f"{key}`" not in page] == []


def test_a_dbc_file_is_found_beside_the_rig_file_by_tools_and_by_nodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A node knows its rig file from --params-file alone, and may run in any folder."""
    for name in ("elbow_vendor_dbc.yaml", "pneumatic_manifold.dbc"):
        (tmp_path / name).write_text((CONFIG / name).read_text())
    path = tmp_path / "elbow_vendor_dbc.yaml"
    dbc = str((tmp_path / "pneumatic_manifold.dbc").resolve())
    assert load_rig(path).boards["manifold"]["dbc"] == dbc
    given_to_node = yaml.safe_load(path.read_text())["/**"]["ros__parameters"]
    monkeypatch.setattr("sys.argv", ["driver_node", "--ros-args", "--params-file", str(path)])
    assert rig_of_node(given_to_node, ()).boards["manifold"]["dbc"] == dbc
    save_rig(load_rig(path), tmp_path / "improved.yaml")
    assert "dbc: pneumatic_manifold.dbc" in (tmp_path / "improved.yaml").read_text()
    assert load_rig(tmp_path / "improved.yaml") == load_rig(path)


def test_lists_of_a_board_survive_the_parameters_of_a_node() -> None:
    """ROS hands a node an array in place of each list of numbers."""
    tree = yaml.safe_load((CONFIG / "elbow_vendor_dbc.yaml").read_text())["/**"]["ros__parameters"]
    tree["boards"]["manifold"]["state"]["active"] = array("q", [2])
    tree["boards"]["manifold"]["supply"]["scale"] = {"V": array("d", [0.0, 10.0])}
    section = rig_of_node(tree, ()).boards["manifold"]
    assert section["state"]["active"] == [2]
    assert section["supply"]["scale"] == {"V": [0.0, 10.0]}


@given(
    radius=st.floats(0.005, 0.03),
    supply=st.floats(2e5, 1e6),
    tolerance=st.floats(0.0, 0.5),
    turns=st.floats(1.0, 3.0),
)
def test_numbers_survive_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    radius: float,
    supply: float,
    tolerance: float,
    turns: float,
) -> None:
    rig = load_rig(CONFIG / "elbow.yaml")
    rig = replace(rig, supply_pressure=supply, parameter_tolerance=tolerance)
    rig = rig.with_joint(replace(rig.joint("elbow"), pulley_radius=radius))
    rig = rig.with_muscle(replace(rig.muscle("elbow_flexor"), turns=turns))
    path = tmp_path_factory.getbasetemp() / "numbers.yaml"
    save_rig(rig, path)
    assert load_rig(path) == rig
