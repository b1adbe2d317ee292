"""The page for people: whole, self-contained, and safe whatever a recording calls itself."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from pam_gap.answer import report_figures
from pam_gap.answer.provenance import provenance
from pam_gap.answer.report import (
    RankedCandidate,
    ReportData,
    StageGap,
    Trace,
    render,
    thinned,
    write_report,
)
from pam_gap.diagnosis_files import _delay

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


def test_a_thinned_trace_reaches_to_its_end() -> None:
    """Of 101 s, 80 were shown: what did not fill a whole bin was dropped."""
    for count in (7999, 12625, 20001):
        time = np.linspace(0.0, 101.0, count)
        kept_time, kept = thinned(time, np.sin(time))
        assert kept_time[0] < 0.1
        assert kept_time[-1] > 100.9
        assert kept_time.size == kept.size <= 4000


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were drawn, before they become pictures."""
    found: list[Figure] = []

    def keep(figure: Figure) -> str:
        found.append(figure)
        return "data:image/png;base64,"

    monkeypatch.setattr(report_figures, "_png", keep)
    monkeypatch.setattr(report_figures, "_svg", keep)
    return found


def test_only_the_stage_to_blame_is_coloured(drawn: list[Figure]) -> None:
    """A stage of 3 floors was orange although the verdict was `none`."""
    stages = [StageGap("valve", 3.0), StageGap("joint", 8.0)]
    for named in (None, "joint"):
        report_figures.draw_stages(stages, named)
        boxes = drawn[-1].axes[0].patches
        colours = [box.get_facecolor() for box in boxes[:4]]
        assert len(set(colours)) == (1 if named is None else 2)
        assert (colours[2] != colours[0]) == (named == "joint")


def test_legends_name_what_is_drawn_and_nothing_else(drawn: list[Figure]) -> None:
    """The page spoke of grey parts that it did not have, and hid the measured line."""
    with_parts = data().traces[0]
    without = replace(with_parts, held_out=())
    for trace, grey in ((with_parts, True), (without, False)):
        report_figures.draw_trace(trace)
        upper, lower = drawn[-1].axes
        assert ("grey" in lower.get_xlabel()) == grey == bool(upper.patches)
    measured, *predictions = upper.get_lines()
    assert measured.get_linewidth() > 2.0 * max(line.get_linewidth() for line in predictions)
    assert upper.get_ylabel() == "[rad]"


def test_two_sides_of_one_effect_have_rows_of_their_own(drawn: list[Figure]) -> None:
    """Both rows were called pressure_gain."""
    names = ["pressure_gain (agonist)", "pressure_gain (antagonist)", "creep + leakage"]
    ranking = [RankedCandidate(name, 0.5, 0.4, 0.3, 0.5) for name in names]
    report_figures.draw_ranking(ranking, ["pressure_gain"])
    axis = drawn[-1].axes[0]
    assert [label.get_text() for label in axis.get_yticklabels()] == names
    colours = [line.get_color() for line in axis.get_lines()[::2]][:3]
    assert colours == [report_figures.IMPROVED, report_figures.IMPROVED, "0.45"]


def test_delays_that_round_to_nothing_are_not_negative() -> None:
    """The page said "-0.0 ms"."""
    assert _delay(-2e-5) == "by less than 0.05 ms"
    assert _delay(0.0034) == "3.4 ms late"
    assert _delay(-0.0034) == "3.4 ms early"


def test_the_page_says_what_it_was_made_from(tmp_path: Path) -> None:
    rig, bag = tmp_path / "rig.yaml", tmp_path / "bag"
    rig.write_text("a: 1\n")
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(b"abc")
    origin = provenance(rig, [bag], "python -m pam_gap diagnose bag").to_json()
    page = render(data(provenance=origin))
    for text in ("python -m pam_gap diagnose bag", str(bag), origin["date"], "pam_gap 0.1.0"):
        assert text in page
    assert origin["recordings"][0]["sha256"][:16] in page
    (bag / "bag_0.mcap").write_bytes(b"abd")
    again = provenance(rig, [bag]).to_json()
    assert again["recordings"][0]["sha256"] != origin["recordings"][0]["sha256"]


def test_sizes_stand_in_the_units_of_the_user() -> None:
    channel = {
        "motion": 0.7, "before": 0.0071, "retuned": 0.0066, "after": 0.0009,
        "limit": 0.0007, "limit_unexplained": 0.0021, "unit": "rad",
    }  # fmt: skip
    page = render(
        data(
            materiality={
                "limit": 0.001,
                "limit_unexplained": 0.003,
                "material": True,
                "channels": {CHANNEL: channel},
            }
        )
    )
    for text in ("7.1 mrad", "0.9 mrad", "0.7 mrad", "0.1 % of the motion", "0.7 rad",
                 "yes; what is left does not"):  # fmt: skip
        assert text in page
