"""The rig file that is written from what the controller has learnt."""

from __future__ import annotations

import pytest

from pam_control.adapted_rig import AdaptedRig, adapted_rig, learnt_of, save_adapted_rig
from pam_control.controller import Controller
from pam_control.settings import ControlSettings
from pam_model.errors import PamError
from pam_model.plant.parameters import NAMES, PlantParameters
from pam_model.rig import load_rig

PAYLOAD = {"payload.mass": 0.5, "payload.distance": 0.2}
NULL_OFFSET = {"agonist.valve_null_offset.offset": 0.03}
GREASE_AND_RUST = {"viscous_friction.extra": 0.2, "coulomb_friction.torque": 0.4}
HYSTERESIS = {"agonist.hysteresis.amplitude": 0.06, "antagonist.hysteresis.amplitude": 0.06}


@pytest.fixture(scope="module")
def law():
    def create(rig, **settings):
        # without soft gains, whose design takes time
        asked = ControlSettings(**{"safe_delay": 0.01, **settings})
        return Controller(rig, asked)

    return create


def played(closed_loop, controller, reaching, effects, true_rig=None):
    """RMS error [rad] of one motion; the plant is that of the controller's rig file, or another."""
    points, duration = reaching
    loop = closed_loop(controller, effects=effects)
    if true_rig is not None:
        true = PlantParameters.from_rig(true_rig).replaced(effects)
        loop.plants[0].change({name: true[name] for name in NAMES})
    loop.run(1.0)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    return loop.run(duration).rms(1.0)


def learnt(closed_loop, controller, reaching, effects):
    """What a controller knows after one motion."""
    played(closed_loop, controller, reaching, effects)
    return [learnt_of(channel) for channel in controller.channels]


def written(closed_loop, law, rig, reaching, effects, path):
    """The rig file of one motion, and its text."""
    known = learnt(closed_loop, law(rig), reaching, effects)
    said = save_adapted_rig(adapted_rig(rig, known), path)
    assert str(path) in said
    return load_rig(path), path.read_text()


def test_a_load_is_written_with_intervals_and_another_controller_is_better_with_the_file(
    closed_loop, law, rig, reaching, tmp_path
):
    new, text = written(closed_loop, law, rig, reaching, PAYLOAD, tmp_path / "loaded.yaml")
    before = played(closed_loop, law(rig, adaptation=False), reaching, PAYLOAD)
    after = played(closed_loop, law(new, adaptation=False), reaching, PAYLOAD, rig)
    assert after < 0.3 * before
    line = next(each for each in text.splitlines() if each.startswith("# elbow.gravity_torque"))
    low, high = (float(word.strip("()")) for word in line.split()[-3::2])
    assert low < rig.joints[0].gravity_torque + 0.5 * 9.80665 * 0.2 < high
    assert high - low < 2.5


def test_friction_is_written_as_friction_and_not_as_a_load(
    closed_loop, law, rig, reaching, tmp_path
):
    new, _ = written(closed_loop, law, rig, reaching, GREASE_AND_RUST, tmp_path / "rusty.yaml")
    joint = new.joints[0]
    assert joint.effects["coulomb_friction"]["torque"] == pytest.approx(0.4, rel=0.15)
    assert joint.viscous_friction == pytest.approx(rig.joints[0].viscous_friction + 0.2, rel=0.15)
    assert joint.gravity_torque == pytest.approx(rig.joints[0].gravity_torque, rel=0.2)


def test_the_opening_of_a_valve_is_written_for_the_valve_that_has_it(
    closed_loop, law, rig, reaching, tmp_path
):
    new, _ = written(closed_loop, law, rig, reaching, NULL_OFFSET, tmp_path / "open.yaml")
    flexor, extensor = new.muscles
    assert flexor.effects["valve_null_offset"]["offset"] == pytest.approx(0.03, abs=0.006)
    assert not extensor.effects
    assert new.joints == rig.joints  # which the motion does not speak against


def test_a_rig_that_is_its_file_is_not_written(closed_loop, law, rig, reaching, tmp_path):
    with pytest.raises(PamError, match="already explains its motion"):
        written(closed_loop, law, rig, reaching, {}, tmp_path / "same.yaml")
    assert not list(tmp_path.iterdir())


def test_hysteresis_is_not_written_as_something_else(closed_loop, law, rig, reaching, tmp_path):
    with pytest.raises(PamError, match="record a motion and diagnose it"):
        written(closed_loop, law, rig, reaching, HYSTERESIS, tmp_path / "no.yaml")


def test_nothing_is_written_before_a_motion_or_over_a_file_or_into_nowhere(
    law, rig, tmp_path, closed_loop, reaching
):
    nothing = [learnt_of(channel) for channel in law(rig).channels]
    with pytest.raises(PamError, match=r"it moved for 0\.0 s .* 3 s are needed"):
        adapted_rig(rig, nothing)
    made = AdaptedRig(rig, ("a number",), ())
    there = tmp_path / "there.yaml"
    there.write_text("mine")
    with pytest.raises(PamError, match="exists, and is not overwritten"):
        save_adapted_rig(made, there)
    assert there.read_text() == "mine"
    with pytest.raises(PamError, match="cannot be written: File exists"):
        save_adapted_rig(made, there / "new.yaml")
    with pytest.raises(PamError, match="cannot be written: File name too long"):
        save_adapted_rig(made, tmp_path / ("x" * 300))
    assert "written" in save_adapted_rig(made, tmp_path / "made" / "new.yaml")
