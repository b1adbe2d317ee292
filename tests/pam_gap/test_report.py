"""The page for people: whole, self-contained, and safe whatever a recording calls itself."""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

import pam_gap
from pam_gap.answer import report, report_figures
from pam_gap.answer.page_style import STYLE, VERDICT_COLOURS
from pam_gap.answer.plots_in_page import NARROW, WIDE, picture
from pam_gap.answer.provenance import provenance
from pam_gap.answer.report import render
from pam_gap.answer.report_figures import GUILTY, STAGES
from pam_gap.answer.report_words import delay_words
from pam_gap.answer.traces import CLOSEST, IMPROVED, MEASURED, NOMINAL, Trace, draw, thinned
from pam_model.effects import EFFECTS
from support.page_plots import plots_and_missing_places

CHANNEL = "joint_states.elbow.position"


TIME = np.linspace(0.0, 40.0, 20000)
TRACE = Trace(CHANNEL, "rad", TIME, 0.4 * np.sin(TIME), 0.36 * np.sin(TIME), 0.4 * np.sin(TIME))


def ranked(label: str, value: float, low: float, high: float) -> dict[str, object]:
    return {"label": label, "remaining": {"value": value, "low": low, "high": high}}


def stage(name: str, gap: float | None, note: str = "") -> dict[str, object]:
    return {"stage": name, "gap_over_floor": gap, "note": note}


def page_of(traces: Sequence[Trace] = (TRACE,), **changes: object) -> str:
    diagnosis: dict[str, object] = {
        "joint": "elbow",
        "verdict": "named",
        "sentence": "The joint rubs: dry friction of 0.52 N m.",
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
        "probabilities": {},
        "leftover": None,
        "materiality": {"limit": 0.001, "limit_unexplained": 0.003, "channels": {}},
        "preferred": "",
        "next_experiment": "slow cycles at two co-contraction levels",
        "stages": [stage("valve", 1.1), stage("muscle", None, "no load cell"),
                   stage("joint", 8.0), stage("sensing", 1.0)],
        "delays": {},
        "regimes": {"low speed": 0.7},
        "ranking": [ranked("coulomb_friction", 0.05, 0.04, 0.07),
                    ranked("hysteresis", 0.4, 0.3, 0.5)],
        "horizons": [{"horizon": "0.5 s", "channel": CHANNEL, "before": 0.03, "after": 0.002,
                      "floor": 0.0004, "unit": "rad"}],
        "repairs": ["pressure_states.elbow_flexor: 3 missing samples were removed"],
        "left_out": ["muscle stage: no load cell"],
        "not_shown": [],
        "provenance": None,
        "facts": {},
    }  # fmt: skip
    answer = "Coulomb friction (torque 0.52 N m): 94 % of an error of 31 mrad"
    return render(diagnosis | changes, answer, traces, "improved_rig.yaml")


def test_page_is_self_contained() -> None:
    """One file that can be mailed: no address outside it is needed to show it."""
    page = page_of()
    assert not re.search(r'(src|href)="(?!data:)', without_scripts(page))
    assert not re.search(r"<script[^>]+src=|<link", page)
    assert "closes 94 % of the gap" in page
    assert page.index("The joint rubs") < page.index("<h2>")


def test_every_plot_has_its_place() -> None:
    """The page of a calibration had none for its first one, and so none was drawn."""
    count, missing = plots_and_missing_places(page_of())
    assert count > 0
    assert missing == []


def test_names_from_outside_are_escaped() -> None:
    """A channel or rig called like a script must not become one."""
    bad = "</script><script>alert(1)</script>"
    page = page_of([replace(TRACE, channel=bad)], joint=bad)
    assert "<script>alert" not in page
    assert "&lt;script&gt;" in without_scripts(page)


def test_a_reader_sees_words_and_no_names_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """The figure and the lists said coulomb_friction where the sentences say Coulomb friction."""
    drawn: list[Figure] = []

    def kept(draw: Callable[[float], Figure], alt: str, look: object) -> str:
        drawn.append(draw(WIDE))
        return f'<img alt="{alt}">'

    monkeypatch.setattr(report, "picture", kept)
    some = page_of(not_shown=["valve_dead_zone"], probabilities={"coulomb_friction": 1.0})
    page = without_scripts(some)
    labels = {text.get_text() for figure in drawn for text in figure.findobj(Text)}
    assert "Coulomb friction" in labels
    assert not {label for label in labels if "_" in label and set(EFFECTS) & set(label.split())}
    assert {name for name in EFFECTS if "_" in name and name in page} == set()
    assert "valve dead zone" in page


def without_scripts(page: str) -> str:
    return re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_verdicts_without_a_name_have_a_page() -> None:
    for verdict in ("none", "unknown", "not_identifiable"):
        page = page_of(verdict=verdict, stage=None, effects=[], parameters={}, closed=None, gap={})
        assert "of the gap closes on data" not in page


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


WIDTHS = pytest.mark.parametrize("width", [WIDE, NARROW])


@WIDTHS
def test_only_the_stage_to_blame_is_coloured(width: float) -> None:
    """A stage of 3 floors was orange although the verdict was `none`."""
    stages = [stage("valve", 3.0), stage("joint", 8.0)]
    for blamed in (set(), {"joint"}, {"muscle", "joint"}):
        boxes = report_figures.draw_stages(stages, blamed, width).axes[0].patches
        coloured = [box.get_facecolor() == mpl.colors.to_rgba(GUILTY) for box in boxes[:4]]
        assert coloured == [stage in blamed for stage in STAGES]


def test_no_text_of_a_figure_is_cut_or_lies_on_another_one() -> None:
    """On a phone, half of each figure was outside of the screen."""
    gap = {f"{kind}_states.a_long_name_of_a_muscle.{kind}": {
        "before": 1e5, "after": 1e3, "floor": 1e2, "unit": "Pa"} for kind in ("joint", "pressure")
    }  # fmt: skip
    names = ["hysteresis + coulomb_friction + command_delay", "valve_null_offset (antagonist)"]
    ranking = [ranked(name, 0.4, 0.01, 0.5) for name in names * 4]
    stages = [stage("valve", 3.0), stage("joint", None)]
    for width in (WIDE, NARROW):
        for figure in (
            report_figures.draw_shrinkage(gap, width=width),
            report_figures.draw_ranking(ranking, ["creep"], width),
            report_figures.draw_stages(stages, {"joint"}, width),
        ):
            FigureCanvasAgg(figure).draw()
            whole = figure.bbox
            (axis,) = figure.axes
            assert axis.get_window_extent().width > 0.4 * whole.width
            boxes = [text.get_window_extent() for text in figure.findobj(Text)
                     if text.get_visible() and text.get_text()]  # fmt: skip
            assert all(whole.x0 - 1 <= box.x0 and box.x1 <= whole.x1 + 1 for box in boxes)
            labels = [text.get_window_extent() for text in axis.get_yticklabels()]
            labels += [text.get_window_extent() for text in axis.texts]
            for one, other in itertools.combinations(labels, 2):
                assert not one.shrunk(0.95, 0.9).overlaps(other.shrunk(0.95, 0.9))


def test_the_measured_curve_is_wide_and_light_and_all_curves_have_names() -> None:
    """The measured line was hidden under the improved one."""
    trace = replace(TRACE, closest=TRACE.nominal, closest_name="creep")
    page = "".join(draw([trace], trace).script.split("docs_json")[1:])
    for name in ("measured", "as written", "improved", "closest"):
        assert f'"value":"{name}"' in page
    assert f'"line_color":"{MEASURED}","line_width":4.0' in page


def test_two_sides_of_one_effect_have_rows_of_their_own() -> None:
    """Both rows were called pressure_gain."""
    names = ["pressure_gain (agonist)", "pressure_gain (antagonist)", "creep + leakage"]
    ranking = [ranked(name, 0.4, 0.3, 0.5) for name in names]
    axis = report_figures.draw_ranking(ranking, ["pressure_gain"]).axes[0]
    assert [label.get_text() for label in axis.get_yticklabels()] == [
        "pressure gain (agonist)",
        "pressure gain (antagonist)",
        "creep + leakage",
    ]
    colours = [line.get_color() for line in axis.get_lines()[::2]][:3]
    assert colours == [report_figures.IMPROVED, report_figures.IMPROVED, "0.45"]


def test_delays_that_round_to_nothing_are_not_negative() -> None:
    """The page said "-0.0 ms"."""
    words = delay_words({"angle": -2e-5, "flexor": 0.0034, "extensor": -0.0034})
    assert words.startswith("angle by less than 0.05 ms; flexor 3.4 ms late; extensor 3.4 ms early")


def test_the_page_says_what_it_was_made_from(tmp_path: Path) -> None:
    rig, bag = tmp_path / "rig.yaml", tmp_path / "bag"
    rig.write_text("a: 1\n")
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(b"abc")
    origin = provenance(rig, [bag], "pam gap diagnose bag").to_json()
    page = page_of(provenance=origin)
    for text in (
        "pam gap diagnose bag",
        str(bag),
        origin["date"],
        f"pam_gap {pam_gap.__version__}",
    ):
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
    page = page_of(
        materiality={
            "limit": 0.001,
            "limit_unexplained": 0.003,
            "material": True,
            "channels": {CHANNEL: channel},
        }
    )
    for text in ("7.1 mrad", "0.9 mrad", "0.7 mrad", "0.1 % of the range", "0.7 rad",
                 "yes; what is left does not"):  # fmt: skip
        assert text in page


def test_a_cause_has_one_probability_and_sets_of_causes_are_folded() -> None:
    """Of one cause, the box said 98 % and the table 36 %: the table was one of sets of causes."""
    shares = {"hysteresis": 0.36, "creep + hysteresis": 0.31, "hysteresis + leakage": 0.31,
              "unknown": 0.016, "none": 0.004}  # fmt: skip
    page = without_scripts(page_of(probabilities=shares, effects=["hysteresis"]))
    open_part, folded = page.split("<details>")
    assert "Probability: hysteresis 98 %" in open_part
    rows = re.findall(r"<td>([^<]+)</td><td class=.n.>([^<]+ %)</td>", open_part)
    assert rows == [("hysteresis", "98 %"), ("creep", "31 %"), ("leakage", "31 %"),
                    ("unknown", "1.6 %")]  # fmt: skip
    assert "36 %" not in open_part
    assert "exclude each other" in folded
    assert "exclude each other" not in open_part
    assert "<td>creep + hysteresis</td>" in folded
    assert "How probable" not in page_of()


def test_a_rival_that_is_nearly_as_probable_stands_in_the_first_lines() -> None:
    """Of 53 and 45 %, the box said only 53 %, and that no further experiment is needed."""

    def answer(shares: dict[str, float]) -> str:
        return page_of(probabilities=shares, effects=["coulomb_friction"], next_experiment="")

    shares = {"coulomb_friction": 0.53, "stribeck_friction": 0.45, "unknown": 0.02}
    page = without_scripts(answer(shares))
    box = " ".join(page.partition("<figure")[0].split())
    assert "Coulomb friction 53 %; not named, but possible: Stribeck friction 45 %" in box
    assert "needs no further experiment" not in page
    shares |= {"coulomb_friction": 0.9, "stribeck_friction": 0.08}
    page = without_scripts(answer(shares))
    assert "not named, but possible" not in page
    assert "needs no further experiment" in page


def test_why_a_simpler_cause_was_preferred_is_said() -> None:
    """A cause was named with weight 0.0 while a pair had 0.88, and the page did not say why."""
    why = "creep + hysteresis fits this recording better, but hysteresis was preferred because"
    assert page_of(preferred=why).count(why) == 1


def test_a_phone_shows_the_headline_and_the_figure_first() -> None:
    """The whole verdict with its cautions stood above the figure, which needed scrolling."""
    page = without_scripts(page_of())
    start = page[page.index("<h1>") : page.index("<figure")]
    assert "Coulomb friction (torque 0.52 N m): 94 % of an error of 31 mrad" in start
    assert len(re.sub(r"<[^>]*>", "", start).split()) < 40
    assert page.index("<figure") < page.index("The joint rubs") < page.index("What to record next")


def test_every_figure_has_a_sentence_that_says_what_to_see() -> None:
    page = without_scripts(page_of())
    figures = re.findall(r"<figure.*?</figure>", page, flags=re.DOTALL)
    assert len(figures) == 6  # the first, stages, ranking, shrinkage, and two of the only channel
    for figure in figures:
        (words,) = re.findall(r"<figcaption[^>]*>(.*?)</figcaption>", figure, flags=re.DOTALL)
        assert len(words.split()) > 5, figure[:200]
        assert words.rstrip().endswith(".")
    assert page.count("<img") == sum(figure.count("<img") for figure in figures)


@pytest.mark.parametrize("low", [0.001, 0.03, 0.31, 0.9, 1.0, 4.1])
@pytest.mark.parametrize("reach", [1.0, 1.02, 1.4, 2.5, 30.0, 1e3, 1e7])
@WIDTHS
def test_no_axis_has_a_single_number(low: float, reach: float, width: float) -> None:
    entry = {"before": reach, "after": low, "floor": 1.0, "unit": "rad"}
    one = ranked("creep", 0.5 * (low + low * reach), low, low * reach)
    for figure in (
        report_figures.draw_shrinkage({CHANNEL: entry}, width=width),
        report_figures.draw_ranking([one], ["creep"], width),
    ):
        axis = figure.axes[0]
        left, right = axis.get_xlim()
        shown = [tick for tick in axis.get_xticks() if left <= tick <= right]
        assert 2 <= len(shown) <= 12


def test_the_first_figure_is_of_the_channel_that_the_verdict_tells_of() -> None:
    """Of a rig with nothing hidden, the sentence told of one muscle and the figure of another."""
    size = {"motion": 1.0, "after": 0.01, "limit": 0.001, "limit_unexplained": 0.003,
            "background": 0.02, "unit": "rad"}  # fmt: skip
    other = replace(TRACE, channel="joint_states.wrist.position")
    channels = {
        CHANNEL: size | {"before": 0.02, "retuned": 0.02},
        other.channel: size | {"before": 0.5, "retuned": 0.01},
    }
    changes: dict[str, object] = {
        "materiality": {"limit": 0.001, "limit_unexplained": 0.003, "channels": channels},
        "verdict": "none",
        "effects": [],
    }
    page = without_scripts(page_of([other, TRACE], **changes))
    assert f"<b>{CHANNEL}: predicted minus measured</b>" in page[: page.index("<h2>")]
    assert "yes; what is left is ordinary" in page


def test_a_long_name_of_what_comes_closest_stands_beside_the_figure_not_in_it() -> None:
    """In the legend it made the page of an unknown cause wider than a phone."""
    first = replace(
        TRACE, closest=TRACE.nominal, closest_name="hysteresis + creep",
        limit=0.0013,
    )  # fmt: skip
    page = page_of([first])
    assert "effects that come closest (hysteresis + creep)" in without_scripts(page)
    assert "In the grey band, ± 1.3 mrad, an error does not matter." in without_scripts(page)
    assert '"value":"closest"' in page and "hysteresis + creep" not in draw([first], first).script


def test_what_is_left_is_said_with_its_size() -> None:
    left = {"rms": 0.0009, "unit": "rad", "channel": CHANNEL, "share_of_motion": 0.0013,
            "material": True, "ordinary": False}  # fmt: skip
    assert f"0.9 mrad at {CHANNEL}, 0.13 % of its range, are not explained. That matters." in (
        page_of(leftover=left)
    )
    assert "no more than ordinary imperfections" in page_of(leftover=left | {"ordinary": True})
    none = page_of(leftover=left, verdict="none")
    assert "are not explained. No effect exceeds it clearly." in none
    assert "That matters." not in none


def test_a_page_of_many_long_traces_is_below_three_megabytes() -> None:
    trace = TRACE
    time = np.linspace(0.0, 600.0, 75_000)
    noise = np.random.default_rng(1).standard_normal((3, time.size))
    long = [
        replace(trace, channel=f"c{k}", time=time, measured=noise[0], nominal=noise[1],
                improved=noise[2], closest=noise[0], closest_name="creep")
        for k in range(6)
    ]  # fmt: skip
    assert len(page_of(long).encode()) < 3_000_000


def luminance(colour: str) -> float:
    """Relative luminance by WCAG 2.2."""
    digits = colour.lstrip("#")
    digits = "".join(2 * d for d in digits) if len(digits) == 3 else digits
    parts = [int(digits[k : k + 2], 16) / 255.0 for k in (0, 2, 4)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def contrast(first: str, second: str) -> float:
    high, low = sorted((luminance(first), luminance(second)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_text_has_the_contrast_of_wcag_aa_in_light_and_dark() -> None:
    light, dark = (dict(re.findall(r"--(\w+): (#\w+)", part)) for part in STYLE.split("@media")[:2])
    for scheme in (light, light | dark):
        for ink in ("ink", "quiet"):
            for paper in ("paper", "box"):
                assert contrast(scheme[ink], scheme[paper]) >= 4.5, (ink, paper)
    for colour in (*VERDICT_COLOURS.values(), NOMINAL, IMPROVED, CLOSEST, MEASURED):
        assert contrast(colour, "#fff") >= 3.0, colour  # graphics, WCAG 1.4.11


def test_a_plot_is_never_wider_than_the_page_that_holds_it() -> None:
    """On a phone of 390 px, the demo's page was 427 px wide."""
    (image,) = re.findall(r"<img [^>]*?alt=", picture(lambda width: Figure((width, 1.0)), "", {}))
    assert "max-width:100%" in image
