"""What a program hands to a public name is checked as a file is: bounds, and names with a hint."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

import pam_control
import pam_driver
import pam_gap
import pam_model
import pam_ros
import pam_sim
from pam_control.controller_parameters import parameter_table
from pam_driver.driver_parameters import TABLE
from pam_driver.driver_settings import NUMBERS
from pam_model.rig.types import Gas, Joint, Muscle, Plausibility, Rig, Valve
from support.rigs import ELBOW
from support.source_tree import PACKAGES

from .test_public_names import PUBLIC, face

RIG = pam_model.load_rig(ELBOW)
PLANT = pam_model.PlantParameters.from_rig(RIG)
JOINT = pam_model.JointStatics.from_rig(RIG)
GEOMETRY = {"thread_length": 0.25, "turns": 2.0, "rest_length": 0.23, "wall_thickness": 0.0}


def _fields(thing: Any) -> dict[str, Any]:
    return {entry.name: getattr(thing, entry.name) for entry in fields(thing) if entry.init}


CALLS: dict[Callable[..., Any], dict[str, Any]] = {
    pam_model.MuscleGeometry: GEOMETRY,
    pam_model.JointStatics: {
        "muscles": JOINT.muscles, "arms": JOINT.arms,
        "ambient_pressure": 101325.0, "exponent": 1.0,
    },
    pam_model.Plant: {"parameters": PLANT, "step": 1e-3},
    pam_model.initial_state: {"parameters": PLANT, "position": 0.0, "velocity": 0.0},
    pam_model.simulate: {
        "parameters": PLANT, "commands": np.zeros((3, 2)), "sample_time": 0.002, "step": 1e-3,
    },
    Rig: _fields(RIG), Gas: _fields(RIG.gas), Joint: _fields(RIG.joints[0]),
    Muscle: _fields(RIG.muscles[0]), Valve: _fields(RIG.muscles[0].valve),
    Plausibility: _fields(RIG.plausibility),
    pam_control.ControlSettings: _fields(pam_control.ControlSettings()),
    pam_control.PressureRatioPid: _fields(pam_control.PressureRatioPid()),
    pam_driver.DriverSettings: _fields(pam_driver.DriverSettings()),
    pam_sim.SimulatedRig: {"rig": RIG, "rate": 1000.0, "step": 1e-3},
    pam_sim.RigLoop: {"rig": pam_sim.SimulatedRig(RIG), "ports": {}, "rate": 1000.0},
    pam_ros.PeriodicLoop: {"step": print, "period": 0.01, "priority": 0},
}  # fmt: skip
"""Calls that succeed; each of their numbers is then replaced by one without a meaning."""
ELSEWHERE = {
    "Diagnosis": "an answer", "Recording": "made by import_recording", "ControlOutput": "an answer",
    "Measurement": "a missing value is NaN", "TrajectoryPoint": "checked by references.follow",
    "PlantParameters": "made by from_rig", "Parameter": "a table in the code",
    "NodeParameters": "ROS", "Driver": "takes DriverSettings",
    "Controller": "takes ControlSettings", "Law": "abstract",
    "CanPort": "made by open_bus",
}  # fmt: skip
"""Public classes of which no user makes an object of numbers."""


def numbers(call: Callable[..., Any], given: dict[str, Any]) -> list[str]:
    """The arguments that are numbers."""
    return [name for name, value in given.items() if type(value) in (float, int)]


CASES = [
    (call, name, value)
    for call, given in CALLS.items()
    for name in numbers(call, given)
    for value in (math.nan, math.inf, -1e300, "wide")
    if name not in ("board", "channel")
    and (name not in ("position", "velocity") or value != -1e300)
]


@pytest.mark.parametrize(
    ("call", "name", "value"), CASES, ids=[f"{c.__name__}.{n}={v}" for c, n, v in CASES]
)
def test_a_number_without_a_meaning_is_refused_by_its_name(call, name, value):
    with pytest.raises(ValueError, match=name) as refused:
        call(**{**CALLS[call], name: value})
    assert "\n" not in str(refused.value)


def test_every_public_class_is_tried_here_or_takes_no_numbers():
    classes = {
        name
        for package in PACKAGES
        for name in PUBLIC[package]
        if inspect.isclass(getattr(face(package), name))
        and not issubclass(getattr(face(package), name), Exception)
    }
    assert classes == {call.__name__ for call in CALLS if inspect.isclass(call)} & classes | set(
        ELSEWHERE
    )


def test_the_calls_with_which_the_numbers_are_tried_succeed():
    for call, given in CALLS.items():
        call(**given)
        assert numbers(call, given) or is_dataclass(call), call


LOOK_UPS: dict[str, tuple[Callable[[], object], str]] = {
    "Rig.joint": (lambda: RIG.joint("elbo"), "elbow"),
    "Rig.muscle": (lambda: RIG.muscle("elbow_flexo"), "elbow_flexor"),
    "Rig.joint_of": (lambda: RIG.joint_of("elbow_flexo"), "elbow_flexor"),
    "Rig.force_model": (lambda: RIG.force_model("elbow_flexo"), "elbow_flexor"),
    "JointStatics.from_rig": (
        lambda: pam_model.JointStatics.from_rig(RIG, joint="elbo"),
        "elbow",
    ),
    "PlantParameters.from_rig": (
        lambda: pam_model.PlantParameters.from_rig(RIG, joint="elbo"),
        "elbow",
    ),
    "PlantParameters[]": (lambda: PLANT["joint.inertiaa"], "joint.inertia"),
    "PlantParameters.replaced": (
        lambda: PLANT.replaced({"coulomb_frictoin.torque": 0.1}),
        "coulomb_friction.torque",
    ),
    "Plant.change": (
        lambda: pam_model.Plant(PLANT).change({"supply_presure": 2e5}),
        "supply_pressure",
    ),
    "EFFECTS": (lambda: pam_model.EFFECTS["coulomb_frictoin"], "coulomb_friction"),
    "registered_models": (lambda: pam_model.registered_models()["tondu"], "tondu_lopez"),
    "create_force_model": (
        lambda: pam_model.create_force_model("tondu_lopes", pam_model.MuscleGeometry(**GEOMETRY)),
        "tondu_lopez",
    ),
    "constants": (
        lambda: pam_model.create_force_model(
            "tondu_lopez", pam_model.MuscleGeometry(**GEOMETRY), {"kk": 1.2}
        ),
        "k",
    ),
    "diagnose_files": (
        lambda: pam_gap.diagnose_files(["x.csv"], ELBOW, "out", joint="elbo"),
        "elbow",
    ),
    "diagnose": (lambda: pam_gap.diagnose([], RIG, joint="elbo"), "elbow"),
    "SimulatedRig": (
        lambda: pam_sim.SimulatedRig(RIG, effects={"coulomb_friction.torq": 0.1}),
        "torque",
    ),
    "SimulatedRig, effect": (
        lambda: pam_sim.SimulatedRig(RIG, effects={"coulomb.torque": 0.1}),
        "coulomb_friction",
    ),
    "RigLoop.schedule": (
        lambda: pam_sim.RigLoop(pam_sim.SimulatedRig(RIG), {}, 100.0).schedule("1 encoder_stuk"),
        "encoder_stuck",
    ),
}


@pytest.mark.parametrize("name", LOOK_UPS)
def test_an_unknown_name_is_told_with_the_one_that_is_near(name):
    look_up, near = LOOK_UPS[name]
    with pytest.raises(pam_model.PamError, match=rf"\b{near}\b") as refused:
        look_up()
    assert "\n" not in str(refused.value)


def test_a_joint_is_found_by_its_name_and_by_its_number():
    by_name = pam_model.PlantParameters.from_rig(RIG, joint="elbow")
    np.testing.assert_array_equal(by_name.values, PLANT.values)
    assert RIG.joint(0) is RIG.joint("elbow")
    for wrong in (1, -1, None):
        with pytest.raises(pam_model.PamError, match="unknown joint"):
            RIG.joint(wrong)
    assert pam_model.JointStatics.from_rig(RIG, joint="elbow").torque((3e5, 2e5), 0.1) == (
        JOINT.torque((3e5, 2e5), 0.1)
    )


@pytest.mark.parametrize("effect", pam_model.EFFECTS)
def test_replaced_has_the_bounds_of_the_file(effect):
    for key, entry in pam_model.EFFECTS[effect].parameters.items():
        name = f"{effect}.{key}"
        assert PLANT.replaced({name: entry.high})
        with pytest.raises(pam_model.PamError, match=name):
            PLANT.replaced({name: entry.high + abs(entry.high)})
        with pytest.raises(pam_model.PamError, match=name):
            PLANT.replaced({name: entry.low - 1.0})


def test_settings_of_the_driver_take_every_parameter_within_its_bounds():
    """Their bounds are wider: a study may make a time-out sharper than the node's."""
    table = {entry.name: entry for entry in TABLE}
    names = {entry.name for entry in fields(pam_driver.DriverSettings) if entry.type == "float"}
    assert set(NUMBERS) == names
    for name, (low, high, unit) in NUMBERS.items():
        if name != "period":
            assert low <= table[name].low and table[name].high <= high, name
            assert unit == table[name].unit
    assert NUMBERS["period"][0] <= 1.0 / table["rate"].high
    assert NUMBERS["period"][1] >= 1.0 / table["rate"].low


def test_settings_of_the_controller_take_every_parameter_within_its_bounds():
    """Their bounds are wider: a test or a study may leave a guard out."""
    from pam_control.controller_parameters import settings_from

    table = {entry.name: entry for entry in parameter_table(["elbow"])}
    given = {name: entry.default for name, entry in table.items()}
    for name, entry in table.items():
        if isinstance(entry.default, float) and not name.startswith("design.") and entry.low >= 0:
            settings_from({**given, name: entry.low}, ["elbow"])
            settings_from({**given, name: entry.high}, ["elbow"])
