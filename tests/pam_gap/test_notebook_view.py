"""A diagnosis as a notebook shows it."""

from __future__ import annotations

from pam_gap.answer.diagnosis import ChannelGap, Diagnosis, FoundParameter
from pam_gap.inference.confidence import Interval

ANSWER = Diagnosis(
    verdict="named",
    stage="joint",
    effects=("coulomb_friction",),
    candidates=(),
    indistinguishable=(),
    parameters={"coulomb_friction": {"torque": FoundParameter(Interval(0.6, 0.5, 0.8), "N m")}},
    gap={"joint_states.elbow.position": ChannelGap(0.028, 0.0002, 0.0001, "rad")},
    closed=None,
    next_experiment="",
    sentence="Friction <of the joint>.",
    joint="elbow",
)
NOTHING = Diagnosis("none", None, (), (), (), {}, {}, None, "", joint="elbow")


def test_the_numbers_are_a_table() -> None:
    table = ANSWER.to_pandas()
    assert table.loc[("coulomb_friction", "torque")].to_dict() == {
        "value": 0.6, "low": 0.5, "high": 0.8, "unit": "N m"
    }  # fmt: skip
    assert NOTHING.to_pandas().empty


def test_a_notebook_shows_verdict_numbers_and_gap() -> None:
    shown = ANSWER._repr_html_()
    assert "elbow: named" in shown
    assert "Friction &lt;of the joint&gt;." in shown
    assert "<td>Coulomb friction</td><td>torque</td><td>0.6 N m</td><td>0.5 N m</td>" in shown
    assert "<td>28 mrad</td><td>0.2 mrad</td>" in shown
    assert "<table>" not in NOTHING._repr_html_()
