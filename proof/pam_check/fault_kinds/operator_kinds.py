"""Stops, starts and restarts at the wrong moment, and faults of a held joint, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pam_check.fault_kinds.fault_kind import (
    BRAKING,
    COMMANDS_STOP,
    VENT,
    FaultKind,
    Reaction,
    Stays,
)
from pam_model.effects import EFFECTS

HELD_LAYER: Final = "held joint"
_K = FaultKind
_R = Reaction
_ANGLE: Final = {"angle": (-0.9, 0.9)}
_ACT: Final = "moving air needs actions: clear, activate and a fresh command"

OPERATOR_KINDS: Final = (
    _K("vent_called", "operator", "someone calls ~/vent", {}, ("vented",), _R.LOWER, VENT,
       "each board receives a frame before the service returns"),
    _K("vent_while_held", "operator", "someone calls ~/vent while the joint is held",
       _ANGLE, ("vented",), _R.LOWER, VENT, "as before"),
    _K("activated_after_vent", "operator", "hold, vent, clear, activate", _ANGLE, (), _R.EITHER,
       2.0, "the controller takes over the present angle"),
    _K("trajectory_while_vented", "operator", "a trajectory is sent while the rig is vented",
       _ANGLE, ("refused references",), _R.RIDE, 2.0, "refused; the joint stays"),
    _K("trajectory_before_activation", "operator", "a trajectory is sent before activation",
       _ANGLE, ("refused references",), _R.RIDE, 2.0, "refused; the joint stays"),
    _K("vent_during_start", "operator", "~/vent while a start waits for a board",
       {"board_after": (0.3, 1.0)}, ("vented",), _R.VENT, 1.5, "a vent cancels the start"),
    _K("clean_up_after_fault", "operator", "fault, clean up, configure, activate", {},
       ("refused activation",), _R.VENT, 1.0, _ACT),
    _K("driver_restarted_after_fault", "operator", "fault, then a new process that activates", {},
       (), _R.VENT, 1.0, _ACT),
    _K("driver_killed_and_restarted", "operator", "killed in motion, then a new process that "
       "activates", {"restart_after": (0.15, 1.0)}, (), _R.VENT, 1.0, _ACT),
    _K("activation_with_fault", "operator", "activation without clearing the fault", {},
       ("refused activation",), _R.VENT, 1.0, _ACT),
    _K("faults_cleared_in_motion", "operator", "faults are cleared and the driver is activated "
       "while it is active", {}, (), _R.RIDE, 1.0, "both change nothing"),
    _K("acts_in_haste", "operator", "vent, clear, activate, again and again", {"times": (2, 6)},
       (), _R.EITHER, 2.0, _ACT, stays=Stays.TRACKING),
    _K("old_commands_after_activation", "operator", "commands from before the activation arrive "
       "after it", {}, ("not_active", "out_of_order", "old"), _R.VENT, 1.0, _ACT),
    _K("hoses_crossed", "operator", "two hoses were exchanged", {},
       ("pressure_implausible", "refused activation"), _R.VENT, 0.2 + BRAKING,
       "the check at start-up, or the first pressures"),
    _K("exhausts_blocked", "operator", "~/vent, but some air stays in the muscles", {}, ("vented",),
       _R.LOWER, VENT, "the pressures are measured: the state is not vented, and there is no "
       "activation", keeps_air=True),
    _K("controller_restarted", "operator", "the controller is started again", {"gap": (0.01, 0.06)},
       (), _R.RIDE, 1.0, "shorter than command_timeout; it takes over the present angle"),
    _K("acts_at_random", "operator", "vent, clear, activate, deactivate, clean up, restarts and "
       "trajectories in a random order", {"acts": (5, 14), "faults": (0, 0)}, (), _R.EITHER, 1.0,
       _ACT, stays=Stays.IN_LIMITS),
    _K("acts_and_faults_at_random", "operator", "the same, with a bus that goes down and boards "
       "that restart", {"acts": (5, 14), "faults": (1, 1)}, (), _R.EITHER, 1.0, _ACT,
       stays=Stays.IN_LIMITS),
)  # fmt: skip

HIDDEN_KINDS: Final = tuple(
    _K(f"hidden_{effect.name}", "hidden effect", f"{effect.description}; then the controller dies",
       {}, ("command_timeout",), _R.EITHER, COMMANDS_STOP + 1.0,
       "the controller tolerates it, or the driver stops", stays=Stays.TRACKING)
    for effect in EFFECTS.values()
)  # fmt: skip


def while_held(kinds: Sequence[FaultKind], names: Sequence[str]) -> list[FaultKind]:
    """The same faults of a joint that is held away from its rest position."""
    return [
        replace(
            kind, name=f"{kind.name}_while_held", layer=HELD_LAYER,
            text=f"{kind.text}, while the joint is held",
        )
        for kind in kinds if kind.name in names
    ]  # fmt: skip
