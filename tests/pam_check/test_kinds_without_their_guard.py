"""Kinds that came from attacks are out of bounds as soon as the guard against them is taken out.

So a kind that is kept shows the guard, and not that the fault is harmless on this rig.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from pam_check.faults.campaign import in_a_fork
from pam_check.faults.trial import run_trial
from pam_control.loop_guard import GuardAction, LoopGuard
from pam_control.reference_limits import ReferenceLimits
from pam_control.references.motion_limiter import MotionLimits
from pam_driver import fault_judge
from pam_driver.board_set import BoardSet
from pam_driver.driver import Driver
from pam_driver.safety import pressure_plausibility
from pam_driver.safety.exhaust_watch import ExhaustWatch
from pam_driver.safety.joint_speed import JointSpeedWatch
from pam_driver.safety.loop_watch import LoopWatch
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.sensor_checks import SensorChecks
from pam_driver.start_up import StartUp
from support.fault_kinds import kind_called

Patch = pytest.MonkeyPatch
Guard = Callable[[Any, Patch], None]


def measurements_stay_young(chain: Any, patch: Patch) -> None:
    step = chain.controller.step
    patch.setattr(
        chain.controller,
        "step",
        lambda now, seen: step(now, replace(seen, position_time=now, pressure_time=now)),
    )


def commands_stay_young(chain: Any, patch: Patch) -> None:
    def renew(now: float) -> None:
        chain.driver._command_time = now

    patch.setattr(chain, "inject", [*chain.inject, renew])


def nobody_watches_the_loop(chain: Any, patch: Patch) -> None:
    patch.setattr(LoopWatch, "conditions", lambda watch: ())
    patch.setattr(JointSpeedWatch, "conditions", lambda watch, now: ())
    patch.setattr(LoopGuard, "judge", lambda *_: GuardAction.NOTHING)
    patch.setattr(PressurePlausibility, "deviations", lambda check: ())


def references_are_kept(chain: Any, patch: Patch) -> None:
    """Nor is a reference refused that is far from the joint."""
    patch.setattr(type(chain.controller), "drop_commands", lambda controller: None)
    nobody_watches_the_loop(chain, patch)


def references_are_taken_while_vented(chain: Any, patch: Patch) -> None:
    references_are_kept(chain, patch)
    patch.setattr(chain.intake, "_reason_against", lambda: "")


def a_start_is_not_cancelled(chain: Any, patch: Patch) -> None:
    patch.setattr(StartUp, "cancel", lambda start: False)


def the_boards_keep_no_fault(chain: Any, patch: Patch) -> None:
    patch.setattr(BoardSet, "latch_fault", lambda boards, now: None)


def nobody_remembers_a_fault(chain: Any, patch: Patch) -> None:
    the_boards_keep_no_fault(chain, patch)
    patch.setattr(StartUp, "leave", lambda start, driver: start.end())


def a_vent_drops_the_arm(chain: Any, patch: Patch) -> None:
    patch.setattr(Driver, "vent", Driver.vent_at_once)


def vented_is_what_the_valves_do(chain: Any, patch: Patch) -> None:
    def update(watch: ExhaustWatch, pressures: Any, venting: bool, now: float) -> None:
        watch.empty = venting

    patch.setattr(ExhaustWatch, "update", update)


def gaps_blind_the_physics(chain: Any, patch: Patch) -> None:
    patch.setattr(pressure_plausibility, "LONGEST_GAP", 0.0)
    patch.setattr(fault_judge, "_RESTARTS", 10**6)


def references_have_no_limits(chain: Any, patch: Patch) -> None:
    for name in chain.rig.joint_names:
        chain.controller.references.limit(name, MotionLimits(1e3, 1e6))
    patch.setattr(ReferenceLimits, "use", lambda limits, stiffnesses: None)


def trajectories_have_any_size(chain: Any, patch: Patch) -> None:
    send = chain.intake.trajectory
    patch.setattr(chain.intake, "trajectory", lambda data, most, at: send(data, 10**6, at))


def nobody_looks_at_the_supply(chain: Any, patch: Patch) -> None:
    patch.setattr(SensorChecks, "update", lambda *_: [])


def nobody_compares_with_physics(chain: Any, patch: Patch) -> None:
    patch.setattr(PressurePlausibility, "deviations", lambda check: ())


HELD = {"angle": 0.75}
KINDS: dict[str, tuple[Guard, dict[str, float]]] = {
    "clock_stops_while_silent": (measurements_stay_young, {}),
    "clock_set_back_while_silent": (measurements_stay_young, {}),
    "commands_without_stamps_stop": (commands_stay_young, {}),
    "frames_delayed_down": (nobody_watches_the_loop, {"delay": 0.05}),
    "frames_delayed_up": (nobody_watches_the_loop, {"delay": 0.04}),
    "activated_after_vent": (references_are_kept, HELD),
    "trajectory_while_vented": (references_are_taken_while_vented, HELD),
    "vent_during_start": (a_start_is_not_cancelled, {}),
    "clean_up_after_fault": (nobody_remembers_a_fault, {}),
    "driver_restarted_after_fault": (the_boards_keep_no_fault, {}),
    "vent_while_held": (a_vent_drops_the_arm, HELD),
    "exhausts_blocked": (vented_is_what_the_valves_do, {}),
    "measurement_gaps_with_valve_stuck_shut": (gaps_blind_the_physics, {}),
    "measurement_gaps_with_burst": (gaps_blind_the_physics, {}),
    "trajectory_too_fast": (references_have_no_limits, {}),
    "trajectory_too_long": (trajectories_have_any_size, {}),
    "supply_too_high": (nobody_looks_at_the_supply, {}),
    "hoses_crossed": (nobody_compares_with_physics, {}),
}


def problem(chain: Any, name: str, drawn: dict[str, float]) -> str:
    kind = kind_called(name)
    values = {key: 0.5 * (low + high) for key, (low, high) in kind.parameters.items()}
    return in_a_fork(lambda: run_trial(chain, kind, values | drawn, 1)).problem


@pytest.mark.sampled("three of the kinds, each with a guard of its own", cases=3)
@pytest.mark.parametrize("name", KINDS)
def test_a_kind_is_kept_with_its_guard_and_out_of_bounds_without(
    chain: Any, name: str, monkeypatch: Patch
) -> None:
    guard, drawn = KINDS[name]
    if drawn:  # the middle of each range is tried in test_faults
        assert problem(chain, name, drawn) == ""

    def without() -> str:
        guard(chain, monkeypatch)
        return problem(chain, name, drawn)

    assert in_a_fork(without) != ""
