"""From a mapping to a rig: all keys are checked, and all problems are reported together."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from pam_model.effects import EFFECTS, Scope
from pam_model.errors import PamError, RigError
from pam_model.muscles.force_model import ForceModel, registered_models, unknown_model
from pam_model.rig.arms import arms_of
from pam_model.rig.bus_keys import beside_rig_file, check_buses, read_buses
from pam_model.rig.keys import NAME, Key, Problems, Section
from pam_model.rig.people import read_people
from pam_model.rig.types import (
    NUMBERS,
    POSITION_LIMITS,
    Gas,
    Joint,
    Muscle,
    Plausibility,
    Rig,
    Valve,
    ValveKind,
)
from pam_model.rig.wiring import Encoder, PressureSensor

_TOP = (
    "gas",
    "joints",
    "bench_muscles",
    "boards",
    "buses",
    "effects",
    "people",
    "plausibility",
    *NUMBERS[""],
)
TRACKING_ERROR = 0.5  # rad, by default at most
TRACKING_SHARE = 0.25  # of a joint's range, by default
USUAL_SUPPLY = 6e5  # Pa gauge; where the file states none, other problems are still found


def _effects(owner: Section, scope: Scope) -> dict[str, dict[str, float]]:
    section = owner.section("effects")
    found: dict[str, dict[str, float]] = {}
    for name, effect in EFFECTS.items():
        if name not in section.tree:
            continue
        values = section.section(name)
        if effect.scope != scope:
            where = {"muscle": "a muscle", "joint": "a joint", "rig": "the top of the file"}
            section.add(name, f": belongs under the effects of {where[effect.scope]}")
            continue
        numbers = {
            key: values.number(key, Key(entry.unit, entry.low, entry.high), optional=True)
            for key, entry in effect.parameters.items()
        }
        values.finish()
        found[name] = {key: value for key, value in numbers.items() if value is not None}
    section.finish(EFFECTS)  # for its hint: what belongs elsewhere has been told above
    return found


def _valve(section: Section, max_pressure: float) -> Valve | None:
    kind = section.get("kind")
    kinds: tuple[ValveKind, ...] = ("flow", "pressure_regulator")
    if kind not in kinds:
        what = ": missing" if kind is None else f" = {kind!r}"
        section.add("kind", f"{what}; must be flow or pressure_regulator")
    keys = NUMBERS["valve"]
    conductance = section.number("sonic_conductance", keys["sonic_conductance"])
    ratio = section.number("critical_ratio", keys["critical_ratio"])
    lag = section.number("time_constant", keys["time_constant"])
    full_scale = section.number("full_scale", keys["full_scale"])
    damping = section.number("damping", keys["damping"])
    if kind == "flow" and full_scale is not None:
        section.add("full_scale", f" = {full_scale:g} Pa: only a pressure_regulator has one")
    if kind == "flow" and damping is not None:
        section.add("damping", f" = {damping:g}: only a pressure_regulator has one")
    section.finish()
    if kind not in kinds or conductance is None or ratio is None or lag is None:
        return None
    if kind == "pressure_regulator" and full_scale is None:
        full_scale = max_pressure
    return Valve(kind, conductance, ratio, lag, full_scale, damping)


def _muscle(section: Section, name: str, max_pressure: float) -> Muscle | None:
    before = len(section.problems.lines)
    model = section.get("model")
    models = registered_models()
    if model not in models:
        missing = f"missing force model; known: {', '.join(models)}"
        section.add("model", f": {missing if model is None else unknown_model(model)}")
    numbers: dict[str, Any] = {
        key: section.number(key, entry)
        for key, entry in NUMBERS["muscle"].items()
        if key != "max_pressure"
    }
    limit = section.number("max_pressure", NUMBERS["muscle"]["max_pressure"], optional=True)
    numbers["max_pressure"] = max_pressure if limit is None else limit
    valve = _valve(section.section("valve"), numbers["max_pressure"])
    board, channel = section.place("board"), section.place("channel")
    if ("board" in section.tree) != ("channel" in section.tree):
        section.add("board", ": board and channel are needed together; one of them is missing")
    sensor = None
    if section.get("pressure_sensor") is not None:
        where = section.section("pressure_sensor")
        places = [where.place(key) for key in ("board", "channel")]
        for key in ("board", "channel"):
            if key not in where.tree:
                where.add(key, ": missing; a pressure_sensor needs board and channel")
        where.finish()
        if places[0] is not None and places[1] is not None:
            sensor = PressureSensor(places[0], places[1])
    constants_of = section.section("model_parameters")
    constants: dict[str, float] = {}
    if model in models:
        for key, entry in models[model].model.parameters.items():
            bounds = Key(entry.unit, entry.low, entry.high, entry.default)
            value = constants_of.number(key, bounds)
            if value is not None and key in constants_of.tree:
                constants[key] = value
        constants_of.finish()
    effects = _effects(section, "muscle")
    section.finish()
    b, rest = numbers["thread_length"], numbers["rest_length"]
    if b is not None and rest is not None and rest >= b:
        section.add("rest_length", f" = {rest:g} m: must be below thread_length = {b:g} m")
    if len(section.problems.lines) > before or valve is None:
        return None
    return Muscle(
        name=name,
        model=str(model),
        valve=valve,
        board=board,
        channel=channel,
        pressure_sensor=sensor,
        model_parameters=constants,
        effects=effects,
        **numbers,
    )


def _joint(section: Section, name: str) -> tuple[Joint | None, list[str]]:
    """A joint (None if it has problems) and the names of its muscles."""
    before = len(section.problems.lines)
    muscles = section.names("muscles") or []
    if len(muscles) == 2 and muscles[0] == muscles[1]:
        section.add(
            "muscles",
            f" = {muscles}: {muscles[0]} is named twice; must be two, [agonist, antagonist]",
        )
    elif muscles and len(muscles) != 2:
        section.add("muscles", f" = {muscles}: must be two, [agonist, antagonist]")
    elif not muscles and "muscles" in section.tree:
        section.add("muscles", ": must be two, [agonist, antagonist]")
    numbers: dict[str, Any] = {
        key: section.number(key, entry) for key, entry in NUMBERS["joint"].items()
    }
    limits = section.get("position_limits")
    ends: list[float | None] = []
    if isinstance(limits, str) or not isinstance(limits, Sequence) or len(limits) != 2:
        what = ": missing" if limits is None else f" = {limits!r}"
        section.add("position_limits", f"{what}; must be [lower, upper] in rad")
    else:
        ends = [section.check("position_limits", value, POSITION_LIMITS) for value in limits]
        if None not in ends and not ends[0] < ends[1]:  # type: ignore[operator]
            section.add("position_limits", f" = {list(limits)} rad: lower must be below upper")
    encoder = None
    if section.get("encoder") is not None:
        where = section.section("encoder")
        board = where.place("board")
        channel = where.place("channel", 0)
        if "board" not in where.tree:
            where.add("board", ": missing; the number or the name of a board is needed")
        where.finish()
        if board is not None and channel is not None:
            encoder = Encoder(board, channel)
    effects = _effects(section, "joint")
    section.finish()
    if len(section.problems.lines) > before:
        return None, muscles
    low, high = (float(end or 0.0) for end in ends)
    if numbers["max_tracking_error"] is None:
        numbers["max_tracking_error"] = min(TRACKING_ERROR, TRACKING_SHARE * (high - low))
    return Joint(
        name=name,
        muscles=(muscles[0], muscles[1]),
        position_limits=(low, high),
        encoder=encoder,
        effects=effects,
        **numbers,
    ), muscles


def _check_reach(rig: Rig, problems: Problems) -> None:
    """Check that every muscle's model is valid over the whole range of its joint."""
    models: dict[str, ForceModel] = {}
    for muscle in rig.muscles:
        try:
            models[muscle.name] = rig.force_model(muscle.name)
        except PamError as error:
            problems.add(f"{muscle.name}.model", f" = {muscle.model}: {error}")
    arms = {rig.muscle_names[arm.muscle]: arm for arm in arms_of(rig)}
    for muscle in rig.muscles:
        model = models.get(muscle.name)
        if model is None:
            continue
        arm = arms.get(muscle.name)
        positions = (0.0,) if arm is None else rig.joints[arm.joint].position_limits
        for position in positions:
            length = muscle.neutral_length - (0.0 if arm is None else arm.length * position)
            low, high = model.length_bounds
            where = f" = {muscle.neutral_length:g} m: at position {position:g} rad"
            if not low < length < high:
                problems.add(
                    f"{muscle.name}.neutral_length",
                    f"{where} the length would be {length:.4g} m; model {muscle.model} needs it "
                    f"between {low:.4g} and {high:.4g} m (neutral_length, pulley_radius or "
                    "position_limits)",
                )
                continue
            try:
                volume = float(model.volume(length))
                force = float(model.force(muscle.max_pressure, length))
            except PamError as error:
                problems.add(f"{muscle.name}.neutral_length", f"{where}: {error}")
                continue
            if not (volume > 0.0 and math.isfinite(force)):
                problems.add(
                    f"{muscle.name}.neutral_length",
                    f"{where} gas volume {volume:g} m^3, force {force:g} N are not plausible",
                )


def _check_wiring(rig: Rig, problems: Problems) -> None:
    """Check that no two muscles, and no two encoders, share a channel."""
    used: dict[tuple[str, int | str, int | str], str] = {}
    inputs = (
        [
            ("board", muscle.board, muscle.channel, muscle.name)
            for muscle in rig.muscles
            if muscle.board is not None
        ]
        + [
            ("pressure_sensor.board", sensor.board, sensor.channel, muscle.name)
            for muscle in rig.muscles
            if (sensor := muscle.pressure_sensor) is not None
        ]
        + [
            ("encoder.board", joint.encoder.board, joint.encoder.channel, joint.name)
            for joint in rig.joints
            if joint.encoder is not None
        ]
    )
    for kind, board, channel, name in inputs:
        assert board is not None and channel is not None
        other = used.setdefault((kind, board, channel), name)
        if other != name:
            problems.add(f"{name}.{kind}", f" = {board}, channel {channel}: {other} uses it too")


def unflatten(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys as nested mappings: {"gas.temperature": 1} -> {"gas": {"temperature": 1}}."""
    tree: dict[str, Any] = {}
    for key, value in parameters.items():
        *path, last = str(key).split(".")
        branch = tree
        for step in path:
            deeper = branch.setdefault(step, {})
            if not isinstance(deeper, dict):
                raise RigError(f"{key}: {step} is both a value and a section")
            branch = deeper
        inner = unflatten(value) if isinstance(value, Mapping) else value
        if isinstance(inner, dict) and isinstance(branch.get(last), dict):
            branch[last] = {**branch[last], **inner}
        else:
            branch[last] = inner
    return tree


def _gas(section: Section) -> Gas | None:
    numbers: dict[str, Any] = {
        key: section.number(key, entry) for key, entry in NUMBERS["gas"].items()
    }
    section.finish()
    return None if None in numbers.values() else Gas(**numbers)


def _plausibility(section: Section) -> Plausibility:
    numbers = {key: section.number(key, entry) for key, entry in NUMBERS["plausibility"].items()}
    section.finish()
    return Plausibility(**{key: value for key, value in numbers.items() if value is not None})


def _says_all_names(tree: Mapping[str, Any]) -> bool:
    """Whether `joints` is a list of names, and each of them has two muscles."""
    names = tree.get("joints")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return False
    sections = [tree.get(name) for name in names]
    muscles = [one.get("muscles") for one in sections if isinstance(one, Mapping)]
    named = all(NAME.fullmatch(name) and name not in _TOP for name in names)
    return named and all(
        isinstance(m, list) and len({*map(str, m)}) == len(m) == 2 for m in muscles
    )


def _joints(top: Section, bench: list[str]) -> tuple[list[Joint], dict[str, str]]:
    """The joints without problems, and every named muscle with the key that names it."""
    names = top.names("joints") or []
    joints: list[Joint] = []
    wanted: dict[str, str] = dict.fromkeys(bench, "bench_muscles")
    for name in dict.fromkeys(names):
        if name in _TOP:
            top.add("joints", f": {name} is a key of the rig file and cannot name a joint")
            continue
        if top.get(name) is None:
            top.add(name, ": missing; joints names it, so it needs a section")
            continue
        joint, muscle_names = _joint(top.section(name), name)
        if joint is not None:
            joints.append(joint)
        for muscle_name in dict.fromkeys(muscle_names):
            owner = wanted.setdefault(muscle_name, name)
            if owner != name:
                top.add(f"{name}.muscles", f": {muscle_name} already belongs to {owner}")
    for name in sorted({name for name in names if names.count(name) > 1}):
        top.add("joints", f": {name} appears twice")
    if top.tree.get("joints") is not None and not names and not bench:
        top.add("joints", ": names no joint, and there are no bench_muscles")
    return joints, wanted


def _muscles(
    top: Section, wanted: Mapping[str, str], joint_names: Collection[str], max_pressure: float
) -> list[Muscle]:
    muscles: list[Muscle] = []
    for name, owner in wanted.items():
        if name in joint_names or name in _TOP:
            top.add(name, f": {owner} names it as a muscle, but the name has another use already")
        elif top.get(name) is None:
            top.add(name, f": missing; {owner} names it as a muscle, so it needs a section")
        else:
            muscle = _muscle(top.section(name), name, max_pressure)
            if muscle is not None:
                muscles.append(muscle)
    return muscles


def parse_rig(
    tree: Mapping[str, Any],
    source: str,
    other_keys: Collection[str] = (),
    folders: Sequence[Path] = (),
    must_reach: bool = True,
) -> Rig:
    """Create a rig from a nested mapping.

    Parameters
    ----------
    tree : mapping
        The content of `ros__parameters`.
    source : str
        Name of the source in messages, usually a path.
    other_keys : collection of str
        Keys at the top that do not belong to the rig, such as a node's own parameters.
    folders : sequence of Path
        Where `boards.<name>.dbc` is searched if it is a relative path: the rig file's folder.
    must_reach : bool
        Whether the model of every muscle must be valid over the whole range of its joint.

    Raises
    ------
    RigError
        With one line for every problem: source, key, value, unit, what was expected.
    """
    problems = Problems(source)
    top = Section(tree, "", problems)
    numbers: dict[str, Any] = {key: top.number(key, entry) for key, entry in NUMBERS[""].items()}
    gas = _gas(top.section("gas"))
    supply = numbers["supply_pressure"]
    gauge = USUAL_SUPPLY
    if gas is not None and supply is not None:
        if supply > gas.ambient_pressure:
            gauge = supply - gas.ambient_pressure
        else:
            top.add("supply_pressure", f" = {supply:g} Pa absolute: must be above ambient")
    bench = (top.names("bench_muscles") or []) if "bench_muscles" in top.tree else []
    top.asked.append("bench_muscles")
    joints, wanted = _joints(top, bench)
    muscles = _muscles(top, wanted, [joint.name for joint in joints], gauge)
    effects = _effects(top, "rig")
    plausibility = _plausibility(top.section("plausibility"))
    people = read_people(top.section("people"))
    sections = top.section("boards").named_sections()
    boards = {name: beside_rig_file(section, folders) for name, section in sections.items()}
    buses = read_buses(top.section("buses"))
    check_buses(buses, boards, top.section("boards"))
    # while it is not known which sections are wanted, none is strange
    any_name = [] if _says_all_names(top.tree) else list(top.tree)
    top.finish([*other_keys, *any_name])
    if not problems.lines and gas is not None:
        rig = Rig(
            gas=gas,
            joints=tuple(joints),
            # Bench muscles were added first, to detect joints that claim one; they are listed last.
            muscles=tuple(sorted(muscles, key=lambda muscle: muscle.name in bench)),
            effects=effects,
            plausibility=plausibility,
            people=people,
            boards=boards,
            buses=buses,
            **numbers,
        )
        if must_reach:
            _check_reach(rig, problems)
        _check_wiring(rig, problems)
        if not problems.lines:
            return rig
    raise RigError("\n".join(problems.lines))
