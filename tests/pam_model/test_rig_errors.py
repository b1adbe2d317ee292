"""Bad rig files: all problems are reported, each in one line with key, value, expectation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.errors import PamError, RigError
from pam_model.rig import load_rig, rig_from_parameters

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
DROP = object()


def tree_with(changes: dict[str, Any]) -> dict[str, Any]:
    """The elbow's parameters, with dotted keys set or removed."""
    tree = load_rig(ELBOW).to_parameters()
    for key, value in changes.items():
        *path, last = key.split(".")
        branch = tree
        for step in path:
            branch = branch.setdefault(step, {})
        if value is DROP:
            del branch[last]
        else:
            branch[last] = value
    return tree


F, E = "elbow_flexor", "elbow_extensor"
CASES: list[tuple[str, dict[str, Any], str]] = [
    (
        "supply in bar",
        {"supply_pressure": 7.0},
        "supply_pressure = 7 Pa absolute: must be from 105000 to 2.5e+06 Pa absolute; "
        "looks like bar, Pa expected",
    ),
    ("supply in kPa", {"supply_pressure": 600}, "looks like kPa, Pa expected"),
    ("supply missing", {"supply_pressure": DROP}, "supply_pressure: missing; a number in Pa"),
    (
        "supply below ambient",
        {"supply_pressure": 1.06e5, "gas.ambient_pressure": 1.1e5},
        "must be above ambient",
    ),
    ("ambient in hPa", {"gas.ambient_pressure": 1.01325}, "looks like bar"),
    ("temperature in deg C", {"gas.temperature": 20.0}, "gas.temperature = 20 K"),
    ("exponent", {"gas.polytropic_exponent": 1.67}, "must be from 1 to 1.4"),
    ("NaN", {"elbow.inertia": float("nan")}, "elbow.inertia = nan kg m^2: must be a finite"),
    ("infinite", {"elbow.inertia": float("inf")}, "must be a finite number"),
    ("huge integer", {"elbow.inertia": 10**400}, "must be a finite number"),
    ("text", {"elbow.inertia": "heavy"}, "elbow.inertia = 'heavy': must be a number in kg m^2"),
    ("decimal comma", {"elbow.inertia": "0,05"}, "in kg m^2, with a decimal point: 0.05"),
    ("quotes", {"elbow.inertia": "0.05"}, "in kg m^2, without quotes: 0.05"),
    ("bool", {"elbow.inertia": True}, "elbow.inertia = True: must be a number"),
    ("list", {"elbow.inertia": [0.05]}, "must be a number"),
    ("radius in mm", {"elbow.pulley_radius": 30.0}, "looks like mm or cm, m expected"),
    ("negative friction", {"elbow.viscous_friction": -1.0}, "must be from 0 to 1000"),
    ("speed in deg/s", {"elbow.max_velocity": 180.0}, "looks like deg/s, rad/s expected"),
    ("no acceleration", {"elbow.max_acceleration": 0.0}, "from 0.1 to 100000 rad/s^2"),
    ("error of 0", {"elbow.max_tracking_error": 0.0}, "max_tracking_error = 0 rad: must be"),
    ("negative rate", {"elbow.max_stiffness_rate": -1.0}, "max_stiffness_rate = -1 N m/(rad s)"),
    ("limits in deg", {"elbow.position_limits": [-57.0, 57.0]}, "looks like deg, rad expected"),
    ("limits swapped", {"elbow.position_limits": [1.0, -1.0]}, "lower must be below upper"),
    ("one limit", {"elbow.position_limits": [1.0]}, "must be [lower, upper] in rad"),
    ("no limits", {"elbow.position_limits": DROP}, "position_limits: missing"),
    ("misspelt key", {"elbow.pully_radius": 0.03}, "unknown key; did you mean pulley_radius?"),
    ("misspelt at top", {"suply_pressure": 7e5}, "did you mean supply_pressure?"),
    ("stray section", {"wrist": {"inertia": 0.1}}, "wrist: no joint or muscle has this name"),
    ("section is a number", {"elbow": 3.0}, "elbow = 3.0: must be a mapping"),
    ("joints missing", {"joints": DROP}, "joints: missing; must be a list of names"),
    ("joints text", {"joints": "elbow"}, "joints = 'elbow'; must be a list of names"),
    ("no joints", {"joints": []}, "names no joint"),
    ("joint twice", {"joints": ["elbow", "elbow"]}, "elbow appears twice"),
    ("joint without section", {"joints": ["elbow", "knee"]}, "knee: missing; joints names it"),
    ("joint called gas", {"joints": ["elbow", "gas"]}, "gas is a key of the rig file"),
    ("bad name", {"joints": ["left elbow"]}, "'left elbow' is not a name"),
    ("one muscle", {"elbow.muscles": [F]}, "must be two, [agonist, antagonist]"),
    ("same muscle twice", {"elbow.muscles": [F, F]}, "must be two, [agonist, antagonist]"),
    ("muscles missing", {"elbow.muscles": DROP}, "elbow.muscles: missing"),
    (
        "muscle without section",
        {"elbow.muscles": [F, "triceps"]},
        "triceps: missing; elbow names it as a muscle",
    ),
    (
        "muscle of two joints",
        {
            "joints": ["elbow", "wrist"],
            "wrist": {
                "muscles": [F, E],
                "pulley_radius": 0.02,
                "inertia": 0.01,
                "position_limits": [-0.5, 0.5],
            },
        },
        f"wrist.muscles: {F} already belongs to elbow",
    ),
    ("muscle on joint and bench", {"bench_muscles": [F]}, "already belongs to bench_muscles"),
    ("muscle is the joint", {"elbow.muscles": [F, "elbow"]}, "the name has another use already"),
    ("unknown model", {f"{F}.model": "chou_hanaford"}, "did you mean chou_hannaford"),
    ("no model", {f"{F}.model": DROP}, f"{F}.model: missing force model"),
    ("unknown constant", {f"{F}.model_parameters.k": 1.0}, "model_parameters.k: unknown key"),
    (
        "constant out of bounds",
        {f"{F}.model": "tondu_lopez", f"{F}.model_parameters.k": 9.0},
        "model_parameters.k = 9: must be from 0.5 to 5",
    ),
    ("length in mm", {f"{F}.thread_length": 275.8}, "looks like mm or cm, m expected"),
    (
        "rest beyond thread",
        {f"{F}.rest_length": 0.2758},
        "rest_length = 0.2758 m: must be below thread_length = 0.2758 m",
    ),
    (
        "stroke beyond thread",
        {"elbow.pulley_radius": 0.06},
        "the length would be 0.285 m; model chou_hannaford needs it between 0 and 0.2758 m",
    ),
    ("wall fills braid", {f"{F}.wall_thickness": 0.02}, "the length would be"),
    (
        "wall thicker than the braid",
        {f"{F}.wall_thickness": 0.02, f"{F}.turns": 3.0},
        "fills the braid",
    ),
    ("volume in ml", {f"{F}.dead_volume": 20.0}, "looks like cm^3 or ml, m^3 expected"),
    ("pressure in bar", {f"{F}.max_pressure": 6.0}, "looks like bar or psi, Pa expected"),
    ("valve kind", {f"{F}.valve.kind": "servo"}, "must be flow or pressure_regulator"),
    ("no valve", {f"{F}.valve": DROP}, "valve.sonic_conductance: missing"),
    (
        "conductance unit",
        {f"{F}.valve.sonic_conductance": 0.4},
        "looks like L/(s bar)",
    ),
    ("time in ms", {f"{F}.valve.time_constant": 5}, "looks like ms, s expected"),
    ("critical ratio", {f"{F}.valve.critical_ratio": 1.0}, "must be from 0 to 0.99"),
    ("full scale of flow", {f"{F}.valve.full_scale": 6e5}, "only a pressure_regulator has one"),
    ("board number", {f"{F}.board": -1}, "must be a whole number from 0 on, or a name"),
    ("board part", {f"{F}.board": 0.5}, "must be a whole number from 0 on, or a name"),
    ("board text", {f"{F}.board": "0 left"}, "must be a whole number from 0 on, or a name"),
    ("channel truth", {f"{F}.channel": True}, "must be a whole number from 0 on, or a name"),
    ("boards", {"boards": [1]}, "boards = [1]: must be a mapping of keys"),
    ("boards without kind", {"boards": {"arm": {"bus": "can0"}}}, "a section with the key kind"),
    ("boards by number", {"boards": {"0": {"kind": "pam_board"}}}, "0: is not a name"),
    ("board without channel", {f"{F}.channel": DROP}, "board and channel are needed together"),
    ("same channel", {f"{F}.channel": 1}, f"{F} uses it too"),
    ("encoder without board", {"elbow.encoder": {"channel": 0}}, "encoder.board: missing"),
    ("unknown effect", {f"{F}.effects.histeresis.amplitude": 0.1}, "did you mean hysteresis?"),
    ("unknown parameter", {f"{F}.effects.hysteresis.size": 0.1}, "hysteresis.size: unknown key"),
    (
        "effect out of bounds",
        {f"{F}.effects.hysteresis.amplitude": 8.0},
        "amplitude = 8: must be from 0 to 0.5",
    ),
    (
        "effect misplaced",
        {f"{F}.effects.payload.mass": 1.0},
        "belongs under the effects of a joint",
    ),
    ("rig effect misplaced", {f"{F}.effects.supply_droop.volume": 1e-3}, "the top of the file"),
    ("joint effect at top", {"effects.leakage.conductance": 1e-10}, "the effects of a muscle"),
    ("effect is a number", {f"{F}.effects.leakage": 1e-10}, "must be a mapping"),
]


@pytest.mark.parametrize(
    ("changes", "expected"), [case[1:] for case in CASES], ids=[case[0] for case in CASES]
)
def test_problem_is_named(changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(RigError) as caught:
        rig_from_parameters(tree_with(changes), source="my_rig.yaml")
    message = str(caught.value)
    assert expected in message
    assert all(line.startswith("my_rig.yaml: ") for line in message.splitlines())


def test_lengths_are_judged_with_the_radius_that_holds() -> None:
    """A radius out of reach is refused in both spellings; one that an effect mends is not."""
    with pytest.raises(RigError) as number:
        rig_from_parameters(tree_with({"elbow.pulley_radius": 0.06}))
    with pytest.raises(RigError) as effect:
        rig_from_parameters(tree_with({"elbow.effects.pulley_radius.scale": 2.0}))
    assert str(effect.value) == str(number.value)
    mended = {"elbow.pulley_radius": 0.06, "elbow.effects.pulley_radius.scale": 0.5}
    assert rig_from_parameters(tree_with(mended)).joints[0].pulley_radius == 0.03


def test_all_problems_come_at_once() -> None:
    changes = {
        "supply_pressure": 7.0,
        "elbow.pulley_radius": 30.0,
        f"{F}.valve.kind": "servo",
        f"{E}.turns": DROP,
        "typo": 1,
    }
    with pytest.raises(RigError) as caught:
        rig_from_parameters(tree_with(changes))
    assert len(str(caught.value).splitlines()) == len(changes)


def test_two_encoders_on_one_input() -> None:
    tree = load_rig(ELBOW.with_name("two_joints.yaml")).to_parameters()
    tree["elbow"]["encoder"] = {"board": 0, "channel": 0}
    with pytest.raises(RigError, match=r"elbow.encoder.board = 0, channel 0: shoulder uses it"):
        rig_from_parameters(tree)


FILES: list[tuple[str, bytes, str]] = [
    ("empty", b"", "not a rig file"),
    ("no YAML", b"a: [", "not YAML"),
    ("binary", b"\x00\xff\xfe", "not text in UTF-8; save it as UTF-8"),
    ("an old editor", "# Größe\n".encode("latin-1"), "not text in UTF-8; save it as UTF-8"),
    ("tabs", b"/**:\n\tros__parameters:\n", "a tab: use spaces to indent"),
    ("other file", b"name: x\n", "must begin with /**: and ros__parameters:"),
    ("a list", b"- 1\n- 2\n", "not a rig file"),
    ("parameters are text", b"/**:\n  ros__parameters: no\n", "not a rig file"),
    ("key twice", b"/**:\n  ros__parameters:\n    a: 1\n    a: 2\n", "a appears twice"),
    ("alias", b"/**: &x\n  ros__parameters: *x\n", "aliases"),
    ("code", b"/**: !!python/object/apply:os.getcwd []\n", "not YAML"),
    ("too large", b"#" * (1 << 20) + b"\n/**:", "larger than"),
    ("nested deeply", b"[" * 5000, "not YAML"),
    ("a list as key", b"? [1, 2]\n: 3\n", "not YAML"),
]


@pytest.mark.parametrize(
    ("content", "expected"), [case[1:] for case in FILES], ids=[case[0] for case in FILES]
)
def test_file_is_refused(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(RigError) as caught:
        load_rig(path)
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


SLIPS: list[tuple[str, str, str, str]] = [
    # what is written, what a person writes in its place, the place that is told, and the advice
    ("      inertia:", "        inertia:", "line 15, column 9", "begin in the same column"),
    ("      pulley_radius:", "    pulley_radius:", "line 15, column 7", "begin in the same column"),
    ("inertia: 0.05", "inertia 0.05", "in what begins in line 15", "a colon and a blank"),
    ("inertia: 0.05", "inertia:0.05", "in what begins in line 15", "a colon and a blank"),
    ("      inertia:", "\tinertia:", "line 15, column 1", "a tab: use spaces"),
    ("/**:", "a: 1\n---\n/**:", "column 1", "expected a single document"),
    ("joints: [elbow]", "joints: elbow", "joints = 'elbow'", "must be a list of names"),
    ("joints: [elbow]", "joints: [my-elbow]", "joints: 'my-elbow'", "is not a name"),
    ("[elbow_flexor, ", "[elbow_extensor, ", "elbow.muscles", "elbow_extensor is named twice"),
    ("[elbow_flexor, ", "[yes, ", "line 13", 'yes is true or false in YAML: write "yes"'),
    ("701325.0", "701_325", "line 9", "write 701325"),
    ("conductance: 4.0e-09", "conductance: 0.4", "sonic_conductance", "m^3/(s Pa) expected"),
]


@pytest.mark.parametrize("slip", SLIPS, ids=[slip[1].strip() for slip in SLIPS])
def test_a_slip_is_told_with_its_place_and_what_it_needs(
    slip: tuple[str, str, str, str], tmp_path: Path
) -> None:
    """Of one slip, no section that it leaves alone is told as well, and no part of a parser."""
    written, instead, place, advice = slip
    text = ELBOW.read_text()
    assert written in text
    path = tmp_path / "slip.yaml"
    path.write_text(text.replace(written, instead, 1))
    with pytest.raises(RigError) as caught:
        load_rig(path)
    told = str(caught.value)
    assert place in told
    assert advice in told
    assert "byte string" not in told
    assert "no joint or muscle has this name" not in told


def test_a_misspelt_effect_has_its_right_name_as_a_hint(tmp_path: Path) -> None:
    path = tmp_path / "slip.yaml"
    path.write_text(f"{ELBOW.read_text()}    effects: {{coulomb_frictoin: {{torque: 0.6}}}}\n")
    with pytest.raises(RigError, match=r"did you mean coulomb_friction\?"):
        load_rig(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(RigError, match="cannot be read"):
            load_rig(path)


def test_value_and_section_at_once() -> None:
    with pytest.raises(RigError, match="both a value and a section"):
        rig_from_parameters({"gas": 1.0, "gas.temperature": 293.0})


KEYS = st.sampled_from(
    ["supply_pressure", "joints", "elbow", "elbow.muscles", F, f"{F}.valve", f"{F}.effects", "gas"]
)
JUNK: Callable[[], st.SearchStrategy[Any]] = lambda: st.recursive(  # noqa: E731
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)


@given(key=KEYS, value=JUNK())
def test_junk_is_refused_with_a_message_or_read(key: str, value: Any) -> None:
    try:
        rig_from_parameters(tree_with({key: value}))
    except PamError as error:
        assert str(error)
