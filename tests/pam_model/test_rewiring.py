"""What a person is asked to write for exchanged hoses or a turned encoder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pam_model.rig import load_rig
from pam_model.rig.rewiring import crossed_hoses, turned_encoder

RIG = load_rig(Path(__file__).parents[2] / "config" / "two_joints.yaml")


def test_every_key_that_changes_is_named_with_its_value() -> None:
    joint = replace(
        RIG.joints[1],
        position_limits=(-0.5, 0.7),
        gravity_angle=0.2,
        effects={"position_offset": {"offset": 0.1}, "payload": {"mass": 0.5}},
    )
    agonist, antagonist = joint.muscles
    assert turned_encoder(RIG.with_joint(joint), joint) == (
        f"write muscles: [{antagonist}, {agonist}], position_limits: [-0.7, 0.5], "
        "gravity_angle: -0.2, effects: {position_offset: {offset: -0.1}, payload: {mass: 0.5}} "
        f"for {joint.name}"
    )


def test_the_effects_of_valves_and_sensors_go_with_the_hoses() -> None:
    joint = RIG.joints[0]
    first, second = (RIG.muscle(name) for name in joint.muscles)
    own = {"creep": {"ratio": 0.1}, "pressure_bias": {"bias": 1e3}}
    rig = RIG.with_muscle(replace(first, effects=own))
    rig = rig.with_muscle(replace(second, effects={"valve_lag": {"extra_time_constant": 0.01}}))
    assert crossed_hoses(rig, joint) == (
        "exchange board, channel, pressure_sensor, valve, effects.valve_lag and "
        f"effects.pressure_bias of {first.name} and {second.name}"
    )
    assert crossed_hoses(RIG, joint).startswith(
        "exchange board, channel, pressure_sensor and valve"
    )
