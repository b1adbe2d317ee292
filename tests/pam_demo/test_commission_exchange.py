"""What a person says to be exchanged is written to the rig file, and the commissioning goes on."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

import pam_demo.commission.sequence as sequence_module
from pam_demo.commission.commission import write_results
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.exchange import Mend, rewired
from pam_demo.commission.kept import Kept
from pam_demo.commission.sequence import Commissioning
from pam_demo.commission.simulated_port import SimulatedPort
from pam_gap.calibration.calibration import Calibration
from pam_gap.calibration.free_numbers import Said
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_model.rig.partial import PartialRig
from support.commission_ports import EXCHANGES, WiredPort

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
SAID = Said(0.1, 0.01)
OF_A_PERSON = {
    "sign of the joint": Mend.ENCODER, "hoses": Mend.HOSES,
    "sign of both valves": Mend.AT_ROBOT, "sign of one valve": Mend.AT_ROBOT,
}  # fmt: skip
FIRST = "hold small steps of the angle"


@pytest.fixture(scope="module")
def elbow() -> Rig:
    return load_rig(ELBOW)


@pytest.fixture
def asked() -> list[str]:
    """The steps for which permission was asked."""
    return []


@pytest.fixture
def begin(
    elbow: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: list[str]
) -> Callable[..., Commissioned]:
    """Commission up to the first motion of the angle, with a person who sees one thing."""
    monkeypatch.setattr(
        sequence_module,
        "least_favourable",
        lambda _rig, known, *_: ({one.name: one.value for one in known},),
    )

    def run(port: WiredPort, sees: Mend | None, rig: Rig = elbow) -> Commissioned:
        def confirm(mend: Mend, _: str) -> bool:
            if mend is Mend.AT_ROBOT and mend is sees:
                port.exchanged = ""
            return mend is sees

        def ask(what: str) -> bool:
            asked.append(what)
            return FIRST not in what

        partial = PartialRig(rig)
        kept = Kept(tmp_path / "out", "")
        return Commissioning(port, partial, SAID, kept, lambda _: None, ask, confirm=confirm).run()

    return run


@pytest.mark.parametrize("exchanged", EXCHANGES)
def test_what_a_person_confirms_is_mended_and_the_first_motion_is_played(
    elbow: Rig, begin: Callable[..., Commissioned], asked: list[str], exchanged: str
) -> None:
    port = WiredPort(elbow, exchanged)
    done = begin(port, OF_A_PERSON[exchanged])
    assert done.ended.startswith(f"not agreed to: {FIRST}")
    assert [step.motion for step in done.steps] == ["filling"]
    pulses = sum("test pulse" in what for what in asked)  # all were right, changed over
    assert pulses == (2 if OF_A_PERSON[exchanged] is Mend.AT_ROBOT else 1)
    turned = [abs(one.position - port.truth[0].position) for one in port.truth]
    assert max(turned) < 0.2
    again = begin(WiredPort(elbow, port.exchanged), None)  # nobody is asked twice
    assert again.exchanged == done.exchanged
    assert again.ended == done.ended


@pytest.mark.parametrize("exchanged", ["hoses", "sign of the joint"])
def test_what_was_put_right_at_the_robot_meanwhile_is_noticed(
    elbow: Rig, begin: Callable[..., Commissioned], exchanged: str
) -> None:
    """A commissioning that goes on would have played its motions with the muscles changed over."""
    assert begin(WiredPort(elbow, exchanged), OF_A_PERSON[exchanged]).steps
    port = WiredPort(elbow, "")
    again = begin(port, None)
    assert not again.steps
    assert "If it was put right at the robot since, begin again with another folder" in again.ended
    assert max(abs(one.position - port.truth[0].position) for one in port.truth) < 0.2


@pytest.mark.parametrize("exchanged", EXCHANGES)
@pytest.mark.parametrize("sees", [None, Mend.HOSES, Mend.ENCODER])
def test_without_a_person_who_sees_it_an_exchange_ends_it(
    elbow: Rig, begin: Callable[..., Commissioned], exchanged: str, sees: Mend | None
) -> None:
    """An equal pair of muscles looks alike with crossed hoses and a turned encoder."""
    alike = exchanged in ("hoses", "sign of the joint") and sees is not None
    assert bool(begin(WiredPort(elbow, exchanged), sees).steps) == alike


def test_limits_that_the_driver_has_the_wrong_way_round_are_told(
    elbow: Rig, begin: Callable[..., Commissioned]
) -> None:
    effects = {"position_offset": {"offset": 0.1}}
    limits = (-0.8, 0.9)
    joint = replace(elbow.joints[0], position_limits=limits, gravity_angle=0.1, effects=effects)
    rig = elbow.with_joint(joint)
    done = begin(WiredPort(rig, "sign of the joint"), Mend.ENCODER, rig)
    assert not done.steps
    assert "position_limits: [-0.9, 0.8], gravity_angle: -0.1" in done.ended
    assert "effects: {position_offset: {offset: -0.1}}" in done.ended
    assert "muscles: [elbow_extensor, elbow_flexor]" in done.ended


def test_pressures_that_the_driver_permits_the_wrong_muscle_are_told(
    elbow: Rig, begin: Callable[..., Commissioned]
) -> None:
    muscle = elbow.muscles[0]
    effects = {"pressure_gain": {"gain": 1.05}, "creep": {"ratio": 0.1}}
    weak = replace(muscle, max_pressure=0.8 * muscle.max_pressure, effects=effects)
    rig = elbow.with_muscle(weak)
    done = begin(WiredPort(rig, "hoses"), Mend.HOSES, rig)
    assert not done.steps
    assert "exchange board, channel, pressure_sensor, valve and effects.pressure_gain of" in (
        done.ended
    )


def test_a_valve_belongs_to_the_muscle_that_it_fills_with_its_wire_and_what_is_known_of_it(
    elbow: Rig,
) -> None:
    flexor, extensor = elbow.muscles
    rig = elbow.with_muscle(
        replace(flexor, valve=replace(flexor.valve, time_constant=0.02), turns=1.01 * flexor.turns)
    )
    partial = PartialRig(
        rig,
        {"elbow_flexor.valve.critical_ratio": (0.2, 0.3), "elbow.gravity_angle": (-0.1, 0.3)},
        frozenset({"elbow_extensor.valve.time_constant", "elbow_flexor.dead_volume"}),
    )
    found = rewired(partial, Mend.HOSES)
    one, other = found.rig.muscles
    assert (one.name, one.channel, other.channel) == (
        flexor.name, extensor.channel, flexor.channel,
    )  # fmt: skip
    assert other.valve.time_constant == 0.02
    assert one.turns == rig.muscles[0].turns
    assert found.ranges == {
        "elbow_extensor.valve.critical_ratio": (0.2, 0.3), "elbow.gravity_angle": (-0.1, 0.3),
    }  # fmt: skip
    assert found.missing == {"elbow_flexor.valve.time_constant", "elbow_flexor.dead_volume"}
    turned = rewired(partial, Mend.ENCODER)
    assert turned.ranges["elbow.gravity_angle"] == (-0.3, 0.1)
    assert turned.rig.joints[0].muscles == ("elbow_extensor", "elbow_flexor")
    assert rewired(turned, Mend.ENCODER) == partial


def test_effects_go_with_the_part_that_has_them(elbow: Rig) -> None:
    """A rig file that a diagnosis has improved has effects."""
    flexor, extensor = elbow.muscles
    valve = {
        "valve_null_offset": {"offset": 0.02}, "valve_lag": {"extra_time_constant": 0.01},
        "command_delay": {"delay": 0.004}, "pressure_gain": {"gain": 1.05},
    }  # fmt: skip
    own = {"hysteresis": {"amplitude": 0.1}, "dead_volume": {"extra_volume": 1e-5}}
    bias = {"pressure_bias": {"bias": 2e3}}
    rig = elbow.with_muscle(replace(flexor, effects=valve | own))
    rig = rig.with_muscle(replace(extensor, effects=bias))
    zero = {"position_offset": {"offset": 0.1}, "coulomb_friction": {"torque": 0.3}}
    rig = rig.with_joint(replace(rig.joints[0], effects=zero))
    one, other = rewired(PartialRig(rig), Mend.HOSES).rig.muscles
    assert (one.effects, other.effects) == (own | bias, valve)
    turned = rewired(PartialRig(rig), Mend.ENCODER)
    assert turned.rig.joints[0].effects == zero | {"position_offset": {"offset": -0.1}}
    assert rewired(turned, Mend.ENCODER).rig == rig


def test_a_robot_counted_the_other_way_moves_the_other_way(elbow: Rig) -> None:
    effects = {"valve_null_offset": {"offset": 0.02}, "pressure_bias": {"bias": 2e3}}
    joint = replace(
        elbow.joints[0], gravity_torque=1.0, gravity_angle=0.2,
        effects={"position_offset": {"offset": 0.1}},
    )  # fmt: skip
    rig = elbow.with_joint(joint).with_muscle(replace(elbow.muscles[0], effects=effects))
    turned = rewired(PartialRig(rig), Mend.ENCODER).rig
    one, other = SimulatedPort(rig, 0.004), SimulatedPort(turned, 0.004)
    for k in range(500):
        commands = (0.3 * math.sin(0.02 * k), 0.2 * math.cos(0.03 * k))
        seen, also = one.advance(commands), other.advance(commands[::-1])
        assert also.position == pytest.approx(-seen.position, abs=1e-6)
        assert also.pressures[::-1] == pytest.approx(seen.pressures, rel=1e-6, abs=1.0)


def test_the_new_rig_file_has_the_wires_as_they_are(elbow: Rig, tmp_path: Path) -> None:
    partial = PartialRig(elbow)
    rig = rewired(partial, Mend.HOSES).rig
    done = Commissioned(rig=rig, calibration=Calibration("elbow"), exchanged="<b>Crossed.</b>")
    write_results(partial, "elbow", done, tmp_path, Said(0.3, 0.05))
    written = load_rig(tmp_path / "commissioned.yaml")
    assert [m.channel for m in written.muscles] == [m.channel for m in reversed(elbow.muscles)]
    assert "&lt;b&gt;Crossed." in (tmp_path / "commission.html").read_text()


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("state.json", '"exchanged": ""', '"exchanged": "house"'),
        ("recordings/filling.csv", "time", "clock"),
        ("recordings/filling.csv", "0.25", "x"),
    ],
)
def test_a_damaged_file_of_an_interrupted_commissioning_is_named(
    tmp_path: Path, name: str, old: str, new: str
) -> None:
    Kept(tmp_path, "").add("filling", pd.DataFrame({"time": [0.0, 0.25]}))
    path = tmp_path / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(PamError, match=f"{re.escape(str(path))}: not "):
        Kept(tmp_path, "").recording("filling")


def test_only_a_check_that_was_passed_is_not_repeated(tmp_path: Path) -> None:
    Kept(tmp_path, "").check()
    path = tmp_path / "state.json"
    path.write_text(path.read_text().replace("true", '"false"'))
    assert not Kept(tmp_path, "").checked
