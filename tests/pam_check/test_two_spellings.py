"""An effect and the same change written as plain numbers are one robot to everyone who asks.

Effects come from the registry: all whose slots only change numbers that the rig file states.
A file in either spelling is read as the same `Rig`, so that nobody who takes a rig can answer
differently. A rig that a program made may still have the effects: consumers of its `Robot` come
from the code, as every function and class with a parameter that is annotated as a robot, or as one
of its joints, muscles or arms.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import itertools
import math
import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pam_control.compensation.dry_friction import JointFriction
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.joint_models import JointModels
from pam_control.joint_scale import JointScale
from pam_control.rows.muscle_table import MuscleTable
from pam_control.settings import ControlSettings
from pam_driver.boards.protocol import NEVER, Sample
from pam_driver.driver_settings import DriverSettings
from pam_driver.tools.check_rig import check_rig
from pam_model.effects import EFFECTS, Effect, adjusted
from pam_model.effects.slots import TARGETS
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.parameters import PlantParameters
from pam_model.rig import Bus, Joint, Muscle, Rig, Valve, load_rig, save_rig
from pam_model.rig.effects_as_numbers import only_changes_numbers, written_number
from pam_model.rig.partial import load_partial_rig
from pam_model.robot import Robot, compose
from pam_model.views.inverse_dynamics import InverseDynamics
from pam_model.views.joint_numbers import joint_numbers
from support.source_tree import modules

ROOT = Path(__file__).parents[2]
RIGS = ("elbow", "two_joints")
TAKES_ROBOT = re.compile(r"\b(Robot|RobotJoint|RobotMuscle|Arm)\b")
LEFT_OUT = (
    Rig,
    Joint,
    Muscle,
    Valve,
    Robot,
)


# --- the two spellings ----------------------------------------------------------------------------


WRITTEN = [effect for effect in EFFECTS.values() if only_changes_numbers(effect)]
SIZES = {effect.name: [effect.portrait.sizes] for effect in WRITTEN}
SIZES["payload"].append({"mass": 20.0, "distance": 0.35})
SIZES["dead_volume"] += [{"extra_volume": more} for more in (2e-4, 5e-4, 2e-3)]
CASES = [
    pytest.param(rig, effect, sizes, id=f"{rig}-{effect.name}-{place}")
    for rig in RIGS
    for effect in WRITTEN
    for place, sizes in enumerate(SIZES[effect.name])
]


def as_effect(rig: Rig, effect: Effect, sizes: dict[str, float]) -> Rig:
    """The rig with one more effect on all its joints or muscles."""

    def more[Part: (Joint, Muscle)](one: Part) -> Part:
        return replace(one, effects={**one.effects, effect.name: dict(sizes)})

    if effect.scope == "joint":
        return replace(rig, joints=tuple(map(more, rig.joints)))
    return replace(rig, muscles=tuple(map(more, rig.muscles)))


def as_numbers(rig: Rig) -> Rig:
    """The rig with every effect that changes a written number replaced by this number."""

    def changed(entry: Any, owner: type, effects: Any) -> dict[str, float]:
        return {
            found[1]: adjusted(target, getattr(entry, found[1]), effects)
            for target in TARGETS
            if (found := written_number(target)) is not None and found[0] is owner
        }

    return replace(
        rig,
        joints=tuple(
            replace(one, effects={}, **changed(one, Joint, one.effects)) for one in rig.joints
        ),
        muscles=tuple(
            replace(
                one,
                effects={},
                valve=replace(one.valve, **changed(one.valve, Valve, one.effects)),
                **changed(one, Muscle, one.effects),
            )
            for one in rig.muscles
        ),
    )


def both(name: str, effect: Effect, sizes: dict[str, float]) -> tuple[Rig, Rig]:
    spelled = as_effect(load_rig(ROOT / f"config/{name}.yaml"), effect, sizes)
    return spelled, as_numbers(spelled)


@functools.cache
def robots() -> tuple[tuple[str, Robot, Robot], ...]:
    """Every case, as the robots of both spellings."""
    pairs = [(case.id, *both(*case.values)) for case in CASES]
    return tuple((name, compose(spelled), compose(numbers)) for name, spelled, numbers in pairs)


def test_the_registry_has_such_effects_and_they_change_the_robot() -> None:
    assert {"payload", "dead_volume", "viscous_friction", "pulley_radius", "valve_lag"} <= set(
        SIZES
    )
    rig = load_rig(ROOT / "config/elbow.yaml")
    for effect in EFFECTS.values():
        sizes = dict(effect.portrait.sizes)
        changed = (
            replace(rig, effects={effect.name: sizes})
            if effect.scope == "rig"
            else as_effect(rig, effect, sizes)
        )
        assert compose(changed) != compose(rig), f"the robot does not know {effect.name}"


# --- who takes a robot ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Consumer:
    """A function or class that takes a robot, by the parameters that it has."""

    name: str
    call: Callable[..., Any]
    parameters: tuple[inspect.Parameter, ...]

    @property
    def arguments(self) -> dict[str, Callable[[Robot], Any]]:
        given = ARGUMENTS | OF_CONSUMER.get(self.name.rpartition(".")[2], {})
        return {name: made for name, made in given.items() if made is not None}


def consumers() -> Iterator[Consumer]:
    for name, path in sorted(modules().items()):
        if not re.search(r"^from pam_model\.(robot|views)\b", path.read_text(), re.MULTILINE):
            continue
        if path.stem == "__init__" or name.startswith("pam_model.robot."):
            continue  # those compose the robot
        module = importlib.import_module(name)
        for key, found in vars(module).items():
            if getattr(found, "__module__", "") != name or not callable(found):
                continue
            if key.startswith("_"):
                continue  # a public one of the same file asks it
            calls = {key: found}
            if inspect.isclass(found):
                calls |= {
                    f"{key}.{method}": getattr(found, method)
                    for method, entry in vars(found).items()
                    if isinstance(entry, classmethod | staticmethod)
                }
            for called, call in calls.items():
                try:
                    parameters = tuple(inspect.signature(call).parameters.values())
                except ValueError:
                    continue
                if any(TAKES_ROBOT.search(str(one.annotation)) for one in parameters):
                    yield Consumer(f"{name}.{called}", call, parameters)


CONSUMERS = list(consumers())

TIME = 0.3  # s


def statics_of(robot: Robot) -> JointStatics:
    return JointStatics.from_robot(robot, robot.joints[0])


ARGUMENTS: dict[str, Callable[[Robot], Any]] = {
    "robot": lambda robot: robot,
    "rig": lambda robot: robot.rig,
    "pressure": lambda robot: 2.1e5,
    "at_pressure": lambda robot: 5e4,
    "pressures": lambda robot: [1.5e5 + 2e4 * k for k in range(len(robot.muscles))],
    "supply_pressures": lambda robot: [6.5e5] * len(robot.muscles),
    "commands": lambda robot: [0.4 - 0.3 * k for k in range(len(robot.muscles))],
    "setpoints": lambda robot: [0.5] * len(robot.muscles),
    "vents": lambda robot: [0.0] * len(robot.muscles),
    "position": lambda robot: 0.2,
    "positions": lambda robot: [0.2 - 0.1 * k for k in range(len(robot.joints))],
    "velocity": lambda robot: 0.7,
    "velocities": lambda robot: [0.7 + 0.1 * k for k in range(len(robot.joints))],
    "times": lambda robot: [TIME] * len(robot.joints),
    "acceleration": lambda robot: 30.0,
    "torque": lambda robot: 3.0,
    "elapsed": lambda robot: 0.01,
    "opening": lambda robot: -0.7,
    "supply": lambda robot: 6.0e5,
    "volume": lambda robot: 1.7e-4,
    "length": lambda robot: 0.22,
    "places": lambda robot: 5,
    "angle": lambda robot: 0.03,
    "rise": lambda robot: 0.25,
    "high": lambda robot: 5e5,
    "low": lambda robot: 1e4,
    "vented_pressure": lambda robot: 1e4,
    "timeout": lambda robot: 5.0,
    "speed": lambda robot: 0.4,
    "period": lambda robot: 0.002,
    "now": lambda robot: TIME,
    "venting": lambda robot: True,
    "name": lambda robot: "robot",
    "boards": lambda robot: SimpleNamespace(foreign_at=NEVER, pressures=(), angles=(), boards={}),
    "settings": lambda robot: DriverSettings(),
    "min_pressure": lambda robot: 5e3,
    "stiffness": lambda robot: 12.0,
    "stiffnesses": lambda robot: (8.0, 14.0),
    "muscles": lambda robot: robot.muscles[:2],
    "pulley_radius": lambda robot: robot.joints[0].arms[0].length,
    "friction": lambda robot: JointFriction.from_joint(robot.joints[0]),
    "model": statics_of,
    "gas_space": lambda robot: statics_of(robot).muscles[0],
    "reservoir": SupplyReservoir,
    "models": lambda robot: JointModels.of(robot, robot.joints[0], 5e3),
    "dynamics": lambda robot: InverseDynamics.from_joint(robot.joints[0]),
    "scale": lambda robot: JointScale.of(robot.joints[0], statics_of(robot)),
    "dry_friction": lambda robot: JointFriction.from_joint(robot.joints[0]),
    "pressure_lag": lambda robot: 0.01,
}
"""Arguments by their names; each list has its order from the robot."""
OF_CONSUMER: dict[str, dict[str, Callable[[Robot], Any] | None]] = {
    "JointModels": {"settings": lambda robot: ControlSettings()},
    "JointScale": {"settings": lambda robot: ControlSettings()},
    "LoopGuard": {"joints": lambda robot: robot.joints},
    "ReferenceLimits": {
        "rig": lambda robot: robot.rig,
        "joints": lambda robot: [JointModels.of(robot, joint, 5e3) for joint in robot.joints],
        "stiffnesses": lambda robot: [12.0] * len(robot.joints),
    },
    "PressureLoops": {
        "joints": lambda robot: [JointModels.of(robot, joint, 5e3) for joint in robot.joints],
        "table": MuscleTable.of,
        "constants": lambda robot: for_kernel(joint_numbers(robot)),
    },
    "air_drawn": {
        "commands": lambda robot: np.array([0.5, 1.0, -1.0, 0.2]),
        "pressures": lambda robot: np.array([1e5, 2e5, 2e5, 1.5e5]),
    },
    "operating_point": {"pressures": lambda robot: (2e5, 1.5e5)},
    "arm_strokes": {
        "joint": lambda robot: 0,
        "pressures": lambda robot: dict.fromkeys(robot.muscle_names, 2e5),
    },
    "SensorChecks": {
        "pressures": lambda robot: [Sample(2e5, TIME, TIME)] * len(robot.muscles),
        "positions": lambda robot: [Sample(0.1, TIME, TIME)] * len(robot.joints),
    },
}
"""Arguments that mean something else to one consumer, or that it cannot use."""
PARTS: dict[str, Callable[[Robot], tuple[Any, ...]]] = {
    "RobotMuscle": lambda robot: robot.muscles,
    "RobotJoint": lambda robot: robot.joints,
    "Arm": lambda robot: tuple(arm for joint in robot.joints for arm in joint.arms),
}


def argument_sets(consumer: Consumer, robot: Robot) -> Iterator[dict[str, Any]]:
    """The arguments of a consumer, for each joint, muscle or arm that it takes."""
    choices: dict[str, tuple[Any, ...]] = {}
    known = consumer.arguments
    for one in consumer.parameters:
        if str(one.annotation) in PARTS:
            choices[one.name] = PARTS[str(one.annotation)](robot)
        elif one.name in known:
            choices[one.name] = (known[one.name](robot),)
        elif one.default is inspect.Parameter.empty:
            pytest.fail(f"{consumer.name}: the test has no argument for {one.name!r}")
    for values in itertools.product(*choices.values()):
        yield dict(zip(choices, values, strict=True))


def methods(made: object, known: Collection[str]) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Public methods of an object whose arguments the test knows, in the order of their text."""
    for key, entry in vars(type(made)).items():
        if key.startswith("_") or not inspect.isfunction(entry):
            continue
        parameters = list(inspect.signature(entry).parameters.values())[1:]
        if all(p.name in known or p.default is not p.empty for p in parameters):
            yield key, entry


def output(consumer: Consumer, robot: Robot) -> list[Any]:
    """All that a consumer answers and keeps, as plain data."""
    found, known = [], consumer.arguments
    for arguments in argument_sets(consumer, robot):
        made = consumer.call(**arguments)
        answers = [plain(made)]
        if inspect.isclass(consumer.call):
            for _ in range(3):
                for key, method in methods(made, known):
                    given = [
                        p for p in list(inspect.signature(method).parameters)[1:] if p in known
                    ]
                    answer = method(made, **{p: known[p](robot) for p in given})
                    answers.append((key, plain(answer)))
            answers.append(plain(made))
        found.append(answers)
    return found


def plain(value: Any, seen: frozenset[int] = frozenset()) -> Any:
    """A value as tuples of numbers and texts; what is as written or code is left out."""
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return value
    if id(value) in seen or isinstance(value, LEFT_OUT) or inspect.isroutine(value):
        return None
    seen |= {id(value)}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    elif isinstance(value, dict):
        value = [(str(key), entry) for key, entry in value.items()]
    elif isinstance(value, set | frozenset):
        value = sorted(map(str, value))
    elif not isinstance(value, list | tuple | Iterator):
        slots = [getattr(one, "__slots__", ()) for one in type(value).__mro__]
        keys = [*getattr(value, "__dict__", {}), *itertools.chain.from_iterable(slots)]
        value = [(key, getattr(value, key, None)) for key in keys if not key.startswith("__")]
    return tuple(plain(entry, seen) for entry in value)


def assert_same(first: Any, second: Any, where: str) -> None:
    if isinstance(first, float) and isinstance(second, float):
        same = first == second or math.isclose(first, second, rel_tol=1e-9, abs_tol=1e-12)
        assert same or (math.isnan(first) and math.isnan(second)), f"{where}: {first} or {second}"
    elif isinstance(first, tuple | list) and isinstance(second, tuple | list):
        assert len(first) == len(second), where
        for place, pair in enumerate(zip(first, second, strict=True)):
            label = pair[0][0] if isinstance(pair[0], tuple) and pair[0] else place
            assert_same(*pair, f"{where}.{label}")
    else:
        assert first == second, where


# --- the property ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("rig", "effect", "sizes"), CASES)
def test_both_spellings_are_one_robot(rig: str, effect: Effect, sizes: dict[str, float]) -> None:
    """Also to those who compose from the rig file by themselves: the plant, and check-rig."""
    spelled, numbers = both(rig, effect, sizes)
    assert spelled != numbers
    assert compose(spelled) == compose(numbers)
    for joint in range(len(spelled.joints)):
        constants = [
            derive_constants(PlantParameters.from_rig(one, joint).values)
            for one in (spelled, numbers)
        ]
        shared = constants[0] == constants[1]
        assert np.all(shared | np.isclose(*constants, rtol=1e-9, atol=0.0))
    first, second = (check_rig(one, Bus(), 500.0) for one in (spelled, numbers))
    assert first == second


@pytest.mark.parametrize(("rig", "effect", "sizes"), CASES)
def test_both_spellings_of_a_file_are_read_as_one_rig(
    tmp_path: Path, rig: str, effect: Effect, sizes: dict[str, float]
) -> None:
    """To whoever takes a rig: diagnosis, calibration, commissioning, learnt files, simulation."""
    spelled, numbers = both(rig, effect, sizes)
    files = tmp_path / "effect.yaml", tmp_path / "numbers.yaml"
    for file, one in zip(files, (spelled, numbers), strict=True):
        save_rig(one, file)
    assert f"{effect.name}:" in files[0].read_text()
    first, second = map(load_rig, files)
    assert first == second == numbers
    first, second = map(load_partial_rig, files)
    assert first == second


BY_HAND = {
    "payload": {"mass": 1.5, "distance": 0.35},
    "viscous_friction": {"extra": 0.3},
    "pulley_radius": {"scale": 0.9},
    "dead_volume": {"extra_volume": 2e-4},
    "valve_lag": {"extra_time_constant": 0.02},
}


def test_the_numbers_that_are_read_are_those_of_the_laws(tmp_path: Path) -> None:
    """By hand, because both spellings above use the laws of the code."""
    rig = load_rig(ROOT / "config/elbow.yaml")
    for name, sizes in BY_HAND.items():
        rig = as_effect(rig, EFFECTS[name], sizes)
    save_rig(rig, tmp_path / "rig.yaml")
    read = load_rig(tmp_path / "rig.yaml")
    was, joint = rig.joints[0], read.joints[0]
    assert joint.inertia == pytest.approx(was.inertia + 1.5 * 0.35**2, rel=1e-12)
    assert joint.gravity_torque == pytest.approx(was.gravity_torque + 1.5 * 9.80665 * 0.35)
    assert joint.viscous_friction == pytest.approx(was.viscous_friction + 0.3)
    assert joint.pulley_radius == pytest.approx(0.9 * was.pulley_radius)
    for before, muscle in zip(rig.muscles, read.muscles, strict=True):
        assert muscle.dead_volume == pytest.approx(before.dead_volume + 2e-4)
        assert muscle.valve.time_constant == pytest.approx(before.valve.time_constant + 0.02)
    assert not any(each.effects for each in (*read.joints, *read.muscles))


@pytest.mark.parametrize("consumer", CONSUMERS, ids=lambda one: one.name)
def test_every_consumer_answers_the_same(consumer: Consumer) -> None:
    for case, spelled, numbers in robots():
        first, second = output(consumer, spelled), output(consumer, numbers)
        assert first, "nothing was compared"
        assert_same(first, second, f"{case}: {consumer.name}")


def test_the_driver_safety_and_the_views_are_among_the_consumers() -> None:
    names = {one.name.rpartition(".")[2] for one in CONSUMERS}
    assert names >= {
        "ExhaustWatch",
        "JointEstimator",
        "JointSpeedWatch",
        "LoweringSetpoints",
        "PressurePlausibility",
        "exhaust_timeout",
        "filling_rate",
        "first_angle_not_held",
        "pulse_of",
        "robot_as_urdf",
    }
