"""The start-up check on a computer that stands still: it accuses no robot that is right.

A pause of the driver may come at any moment of the check, between two cycles or within one. A pulse
that was not watched is repeated; a board that has vented meanwhile, or a computer that stands still
again and again, ends the check with that reason. Neither hides what is really wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pauses import longest_gap
from pam_driver.safety.start_up_check import ABORT_ANGLE, REPETITIONS, StartUpCheck
from pam_driver.safety.states import SafetyState
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose

from .node_bench import ROOT
from .start_up_bench import PATIENCE, PAUSES, TICK, Bench, desk_of, exchanged, free_rig

CHECK_TIME = 2.7  # s, of the example rigs without a pause
NO_WATCHDOG = 1e3  # s
LONGEST_STAY = 0.095  # s; the watchdog of the boards is 0.1 s


class Pause(NamedTuple):
    """When it begins, after the activation [s], how long it is [s], and where in the cycle."""

    begin: float
    duration: float
    where: str


def checked(bench: Bench, pauses: Sequence[Pause]) -> list[str]:
    """Activate, stand still at these moments, and run to the end of the check; its faults."""
    bench.run(lambda: bench.now > 0.6)
    begin, waiting = bench.now, list(pauses)
    bench.driver.activate(begin)
    while bench.driver.state is SafetyState.CHECKING:
        if waiting and bench.now - begin >= waiting[0].begin:
            bench.stand_still(*waiting.pop(0)[1:])
        bench.step()
        assert bench.now - begin < 3.0 * PATIENCE
    return [str(fault) for fault in bench.driver.faults]


def rigs(folder: Path) -> dict[str, Rig]:
    """Flow valves, regulators, and a joint that nothing holds back."""
    return {
        "elbow": load_rig(ROOT / "config/elbow.yaml"),
        "two joints": load_rig(ROOT / "config/two_joints.yaml"),
        "free": free_rig(folder, 1.0, 0.12, 4e-3),
        "free and small": free_rig(folder, 0.1, 0.08, 2e-5),
    }


MOMENTS = st.builds(
    Pause,
    st.floats(0.0, CHECK_TIME),
    st.one_of(st.floats(0.02, LONGEST_STAY), st.floats(0.05, 1.0)),
    st.sampled_from(PAUSES),
)
KINDS = st.sampled_from(["elbow", "two joints", "free", "free and small"])
WATCHDOGS = st.sampled_from([None, NO_WATCHDOG])
DEFECTS = st.sampled_from(["sensors", "hoses", "sign"])


def accuses_no_right_robot(
    folder: Path, kind: str, pauses: Sequence[Pause], watchdog: float | None
) -> None:
    bench = Bench(rigs(folder)[kind], watchdog=watchdog)
    faults = checked(bench, pauses)
    assert not faults or "stood still" in faults[0], faults
    if not faults:
        assert bench.driver.state is SafetyState.READY


def finds_what_is_wrong(
    folder: Path, kind: str, pauses: Sequence[Pause], watchdog: float | None, defect: str
) -> None:
    """Or says that the computer stood still; it never lets the robot go."""
    rig = rigs(folder)[kind]
    bench = Bench(rig, exchanged(rig) if defect != "sensors" else None, watchdog=watchdog)
    if defect != "sign":
        bench.sim.faults.swapped.add(0)
    faults = checked(bench, pauses)
    assert bench.driver.state is not SafetyState.READY
    assert faults
    if "stood still" not in faults[0]:
        assert "exchanged" in faults[0] or "crossed" in faults[0], faults
    # after a longer one, the boards have vented or the driver has had no measurement for too long
    most = LONGEST_STAY if watchdog is None else DriverSettings().board_timeout
    if all(pause.duration < most for pause in pauses) and len(pauses) <= REPETITIONS:
        assert "stood still" not in faults[0], "one pause is no reason to give up"


@settings(max_examples=4, deadline=None)
@given(kind=KINDS, pauses=st.lists(MOMENTS, min_size=1, max_size=2), watchdog=WATCHDOGS)
def test_a_pause_at_any_moment_accuses_no_right_robot(
    tmp_path_factory: pytest.TempPathFactory,
    kind: str,
    pauses: list[Pause],
    watchdog: float | None,
) -> None:
    accuses_no_right_robot(tmp_path_factory.mktemp("rig"), kind, sorted(pauses), watchdog)


@settings(max_examples=3, deadline=None)
@given(
    kind=st.sampled_from(["elbow", "free"]),
    pauses=st.lists(MOMENTS, min_size=1, max_size=2),
    watchdog=WATCHDOGS,
    defect=DEFECTS,
)
def test_an_exchange_is_found_whenever_the_computer_stood_still(
    tmp_path_factory: pytest.TempPathFactory,
    kind: str,
    pauses: list[Pause],
    watchdog: float | None,
    defect: str,
) -> None:
    finds_what_is_wrong(tmp_path_factory.mktemp("rig"), kind, sorted(pauses), watchdog, defect)


@pytest.mark.long("the two tests above try a few moments")
@pytest.mark.parametrize("kind", ["elbow", "two joints", "free", "free and small"])
@pytest.mark.parametrize("duration", [0.051, 0.09, 0.3, 1.0])
def test_pauses_all_along_the_check(tmp_path: Path, kind: str, duration: float) -> None:
    for place in range(18):
        pause = Pause(CHECK_TIME * place / 18, duration, PAUSES[place % 3])
        watchdog = None if place % 2 else NO_WATCHDOG
        accuses_no_right_robot(tmp_path, kind, [pause], watchdog)
        if kind in ("elbow", "free"):
            for defect in ("sensors", "hoses", "sign"):
                finds_what_is_wrong(tmp_path, kind, [pause], watchdog, defect)


def test_a_valve_that_was_left_open_while_nobody_looked_is_no_defect(rig: Rig) -> None:
    """Before: "a pulse of 19280 Pa turns the joint by +0.17 rad: load or sensor differ"."""
    bench = Bench(rig, watchdog=NO_WATCHDOG)
    assert checked(bench, [Pause(0.438, 0.45, PAUSES[2])]) == []
    assert bench.moved > ABORT_ANGLE
    assert bench.driver.state is SafetyState.READY


def test_a_computer_that_stands_still_again_and_again_is_the_reason(rig: Rig) -> None:
    bench = Bench(rig, watchdog=NO_WATCHDOG)
    pauses = [Pause(0.4 * k, 0.06, PAUSES[0]) for k in range(100)]
    (fault,) = checked(bench, pauses)
    assert f"stood still for more than 50 ms {REPETITIONS + 1} times" in fault
    assert "elbow_flexor was tested" in fault
    assert bench.driver.faults[0].kind == "driver_paused"
    assert bench.driver.state is SafetyState.FAULT


def test_each_muscle_has_its_repetitions(rig: Rig) -> None:
    """And a pause while the joint comes to rest is none of a joint that does not come to rest."""
    desk = desk_of(rig)
    now, told = paused(desk.check, desk.answers, REPETITIONS)
    assert told == 2 * (REPETITIONS + 1)
    assert desk.check.findings == ()
    assert now < PATIENCE


def paused(
    check: StartUpCheck, answers: Sequence[Callable[[float], float]], count: int
) -> tuple[float, int]:
    """Answer a check that is paused so often in the pulse of each muscle; its pulses."""
    now, begun, paused_in = 0.0, 0, [0, 0]
    air = [0.0, 0.0]
    before: tuple[float, ...] = (-1.0, -1.0)
    check.start(now)
    while not check.finished:
        fractions = check.setpoints(air, [0.0], now)
        for muscle in (0, 1):
            if fractions[muscle] > 0.0 >= before[muscle]:
                begun += 1
                if paused_in[muscle] < count:
                    paused_in[muscle] += 1
                    now += 0.5
        air = [a(f) if f > 0.0 else 0.0 for a, f in zip(answers, fractions, strict=True)]
        before = fractions
        now += TICK
        assert now < 4.0 * PATIENCE
    return now, begun


def test_at_a_low_rate_a_period_is_no_pause(rig: Rig) -> None:
    assert longest_gap(0.002) == 0.05
    assert longest_gap(0.1) == pytest.approx(0.3)
    check = StartUpCheck(compose(rig), (-1.0, -1.0), period=0.1)
    check.start(0.0)
    now = 0.0
    while not check.finished:
        now += 0.1
        check.setpoints((0.0, 0.0), (0.0,), now)
    assert "stood still" not in check.findings[0].text
