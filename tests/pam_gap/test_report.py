"""The page for people: whole, self-contained, and safe whatever a recording calls itself."""

import re

import numpy as np

from pam_gap.answer.report import (
    RankedCandidate,
    ReportData,
    StageGap,
    Trace,
    render,
    thinned,
    write_report,
)

CHANNEL = "joint_states.elbow.position"


def data(title: str = "elbow", **changes: object) -> ReportData:
    time = np.linspace(0.0, 40.0, 20000)
    measured = 0.4 * np.sin(time)
    diagnosis: dict[str, object] = {
        "verdict": "named",
        "stage": "joint",
        "effects": ["coulomb_friction"],
        "candidates": [["coulomb_friction", 0.93], ["hysteresis", 0.04]],
        "indistinguishable": [["coulomb_friction", "stribeck_friction"]],
        "parameters": {
            "coulomb_friction": {
                "torque": {"value": 0.52, "low": 0.48, "high": 0.56, "unit": "N m"}
            }
        },
        "gap": {CHANNEL: {"before": 0.031, "after": 0.002, "floor": 0.0004, "unit": "rad"}},
        "closed": {"value": 0.94, "low": 0.91, "high": 0.96},
        "next_experiment": "slow cycles at two co-contraction levels",
    }
    diagnosis |= changes
    return ReportData(
        title=title,
        verdict_sentence="The joint rubs: dry friction of 0.52 N m.",
        diagnosis=diagnosis,
        stages=[StageGap("valve", 1.1), StageGap("muscle", None, "no load cell"),
                StageGap("joint", 8.0), StageGap("sensing", 1.0)],
        regimes=[("low speed", 0.7)],
        traces=[Trace(CHANNEL, "rad", time, measured, 0.9 * measured, measured, ((10, 14),))],
        ranking=[RankedCandidate("coulomb_friction", 0.93, 0.05, 0.04, 0.07),
                 RankedCandidate("hysteresis", 0.04, 0.4, 0.3, 0.5)],
        horizons=[("0.5 s", CHANNEL, 0.03, 0.002, 0.0004, "rad")],
        repairs=["pressure_states.elbow_flexor: 3 missing samples were removed"],
        left_out=["muscle stage: no load cell"],
        improved_rig="improved_rig.yaml",
    )  # fmt: skip


def test_page_is_self_contained() -> None:
    """One file that can be mailed: no address outside it is needed to show it."""
    page = render(data())
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert "closes 94 % of the gap" in page
    assert page.index("The joint rubs") < page.index("<h2>")


def test_names_from_outside_are_escaped() -> None:
    """A channel or rig called like a script must not become one."""
    page = render(data(title="<script>alert(1)</script>"))
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_verdicts_without_a_name_have_a_page(tmp_path) -> None:
    for verdict in ("none", "unknown", "not_identifiable"):
        path = tmp_path / f"{verdict}.html"
        write_report(
            data(verdict=verdict, stage=None, effects=[], parameters={}, closed=None, gap={}), path
        )
        assert "of the gap closes on data" not in path.read_text()


def test_thinning_keeps_the_peaks() -> None:
    """A spike of one sample stays visible."""
    time = np.arange(100_000.0)
    values = np.zeros(100_000)
    values[77_777] = 5.0
    values[12_345] = -4.0
    kept_time, kept = thinned(time, values)
    assert kept.size <= 4000
    assert (kept.max(), kept.min()) == (5.0, -4.0)
    assert np.all(np.diff(kept_time) >= 0.0)
