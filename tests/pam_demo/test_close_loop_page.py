"""The page of the closed loop: what was hidden, what was found, and the errors before and after."""

from pathlib import Path

import numpy as np

from pam_demo.close_loop import compared
from pam_demo.close_loop_page import write_page
from pam_demo.motions import DemoMotion
from pam_demo.tracking import ClosedLoopFigure, FollowedAngle, TrackedMotion
from pam_gap.answer.diagnosis import Diagnosis, FoundParameter
from pam_gap.inference.confidence import Interval

TIME = np.linspace(0.0, 6.0, 300)
REFERENCE = 0.3 * np.sin(TIME)
MOTION = DemoMotion("arm", "A real <arm>'s motion", TIME, REFERENCE, REFERENCE, REFERENCE, ())


def tracked(error: float) -> FollowedAngle:
    return FollowedAngle(MOTION, TIME, REFERENCE, REFERENCE - error)


TORQUE = FoundParameter(Interval(0.502, 0.49, 0.52), "N m")
FOUND = Diagnosis(
    "named", "joint", ("coulomb_friction",), (), (), {"coulomb_friction": {"torque": TORQUE}},
    {}, None, "", sentence="The cause is Coulomb friction.",
)  # fmt: skip


def page(tmp_path: Path, after: list[FollowedAngle], figures: list[ClosedLoopFigure]) -> str:
    path = tmp_path / "close_loop.html"
    write_page(path, ["coulomb_friction.torque=0.5"], FOUND, [tracked(0.02)], after, figures)
    return path.read_text(encoding="utf-8")


def test_the_page_tells_hidden_and_found_and_the_errors_of_both_runs(tmp_path: Path) -> None:
    text = page(tmp_path, [tracked(0.001)], [ClosedLoopFigure("arm", 0.02, 0.001, 0.021, 0.0012)])
    for shown in (
        "<b>coulomb_friction.torque=0.5</b>", "The cause is Coulomb friction.", "0.49 to 0.52",
        '<td class="n">20.00</td>', '<td class="n"><span class="good">0.05', "A real &lt;arm&gt;",
    ):  # fmt: skip
        assert shown in text
    for look in ("prefers-color-scheme: dark", "width=device-width", 'class="wide" tabindex="0"'):
        assert look in text, "as on the other pages"


def test_without_a_second_run_the_page_says_why(tmp_path: Path) -> None:
    assert "found no change for the rig file" in page(tmp_path, [], [])


def test_the_errors_of_several_runs_are_compared_by_their_medians() -> None:
    runs = [[TrackedMotion(tracked(error), tracked(0.02))] for error in (0.02, 0.5, 0.01)]
    (found,) = compared(runs, [[TrackedMotion(tracked(0.02), tracked(0.003))]] * 3)
    assert abs(found.before - 0.02) < 1e-12, "not their mean: one run met a busy host"
    assert abs(found.true_after - 0.003) < 1e-12
    assert compared(runs, []) == [], "without an improved rig file nothing is compared"
