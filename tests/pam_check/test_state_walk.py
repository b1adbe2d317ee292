"""The walk over all states finds every way round a stop that is planted."""

from __future__ import annotations

from pathlib import Path

import pytest

from pam_check.state_walk.acts import ACTS
from pam_check.state_walk.walk import Violation, walk
from pam_control.references.reference_generator import ReferenceGenerator
from pam_driver.board_set import BoardSet
from pam_driver.driver import Driver
from pam_driver.safety.states import TRANSITIONS, SafetyEvent, SafetyState
from pam_driver.safety.valve_command_intake import ValveCommandIntake
from pam_driver.start_up import StartUp
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig

ROOT = Path(__file__).parents[2]
ALWAYS = (
    "time passes",
    "the driver starts (autostart)",
    "the operator activates",
    "the controller starts",
)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(ROOT / "config/elbow.yaml")


REDUCED = {
    name: act
    for name, act in ACTS.items()
    if name
    not in {
        "the board is switched off and on",
        "a pressure sensor is lost for a moment",
        "a valve command is held up",
        "the valve command that was held up arrives",
    }
}
"""Acts whose states are few enough for a test; `pam check state-walk` takes all."""


@pytest.mark.parametrize("one_process", [False, True])
def test_no_path_leads_from_a_stop_to_moving_air_without_clear_activate_and_a_command(
    rig: Rig, one_process: bool
) -> None:
    """Restarts of the driver and of the controller included, in every order."""
    found = walk(rig, REDUCED, one_process=one_process)
    assert not found.violations, "\n".join(map(str, found.violations))
    # in one process the driver cannot lose its controller, which is what lowers here after a fault
    least, moving = (300, 15) if one_process else (500, 20)
    assert found.moving > moving and found.states > least
    reached = {"active", "fault", "lowering", "vented"}
    assert reached | (set() if one_process else {"fault_lowering"}) <= set(found.driver_states)


def test_a_fault_that_is_forgotten_when_the_driver_ends_while_it_lowers_is_found(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the joints are lowered, only the driver knows of the fault: it must tell the boards."""

    def close(driver: Driver, now: float) -> None:
        driver.vent_at_once(now)
        driver._event(SafetyEvent.CLEANUP, now)

    monkeypatch.setattr(Driver, "close", close)
    found = first_violation(rig, "the controller is killed", "the driver is ended with Ctrl-C")
    assert found.complaint == "air moves although nobody has cleared the fault"
    assert "the driver is ended with Ctrl-C" in found.path


def first_violation(rig: Rig, *acts: str) -> Violation:
    """The shortest way round a stop that a walk with these acts finds."""
    chosen = {name: ACTS[name] for name in (*ALWAYS, *acts)}
    violations = walk(rig, chosen, ends_early=True).violations
    assert violations, "nothing was found"
    return violations[0]


def test_a_fault_that_no_board_keeps_is_found(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the latch on the boards, a killed driver forgets its fault."""
    monkeypatch.setattr(BoardSet, "latch_fault", lambda *_: None)
    found = first_violation(
        rig, "the driver measures a pressure that is too high", "the driver is killed"
    )
    assert found.complaint == "air moves although nobody has cleared the fault"
    assert "the driver is killed" in found.path
    assert found.path.count("the operator activates") == 2


def test_a_wrong_entry_in_the_table_of_states_is_found(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = TRANSITIONS[SafetyState.VENTED]
    monkeypatch.setitem(row, SafetyEvent.EMPTY, SafetyState.READY)  # type: ignore[arg-type]
    found = first_violation(rig, "the operator vents")
    assert found.complaint.startswith("air moves although nobody has activated the driver")
    assert found.path.count("the operator activates") == 1


def test_an_old_command_that_arrives_after_the_activation_is_found(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ValveCommandIntake, "refuse", lambda *_: None)
    found = first_violation(
        rig,
        "the operator vents",
        "a valve command is held up",
        "the valve command that was held up arrives",
    )
    assert found.complaint == "the driver takes a command from before the activation"


def test_a_start_that_nobody_can_cancel_is_found(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StartUp, "cancel", lambda _: False)
    found = first_violation(
        rig, "the driver starts (autostart, activate_on_start)", "the operator vents"
    )
    assert found.complaint == "the driver activates itself without being asked"


def test_a_reference_that_outlives_a_stop_is_found(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ReferenceGenerator, "hold", lambda *_: None)
    found = first_violation(rig, "the user sends a reference", "the operator vents")
    assert found.complaint == "the joint follows a reference from before the last stop"


def test_the_path_is_told_in_words(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BoardSet, "latch_fault", lambda *_: None)
    text = str(
        first_violation(
            rig, "the driver measures a pressure that is too high", "the driver is killed"
        )
    )
    first, *steps = text.splitlines()
    assert first == "air moves although nobody has cleared the fault:"
    assert steps[0].startswith("  1. ")
    assert all(step.split(". ", 1)[1] in ACTS for step in steps)


def test_a_rig_that_the_walk_cannot_take_is_a_mistake() -> None:
    with pytest.raises(PamError, match="one pam_board and flow valves"):
        walk(load_rig(ROOT / "config/two_joints.yaml"))
