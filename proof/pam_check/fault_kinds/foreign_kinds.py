"""Measurements of other nodes in addition to those of the driver, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import FaultKind, Reaction, Stays
from pam_check.fault_kinds.host_and_command_kinds import TURNS
from pam_sim.fault_injection import MOMENT

_K = FaultKind
_R = Reaction
_PAST: Final = {"past": (0.1, 1.0), **MOMENT}
_MEASURED: Final = "the third message, since the sources of measurements take turns"
# A controller that takes the joint over between two of the messages may believe the wrong angle;
# that the joint does not go there is a claim of its own.

FOREIGN_KINDS: Final = (
    _K("measurements_of_a_second_node_in_degrees", "other nodes", "a second node publishes "
       "joint_states, in degrees", MOMENT, ("controller",), _R.LOWER, TURNS, _MEASURED,
       stays=Stays.IN_LIMITS),
    _K("measurements_of_a_second_node_in_kpa", "other nodes", "a second node publishes "
       "pressure_states, in kPa", MOMENT, ("controller",), _R.LOWER, TURNS, _MEASURED,
       stays=Stays.IN_LIMITS),
    _K("recording_played_into_the_rig", "other nodes", "a recording of the rig is played, with "
       "new stamps: its measurements", _PAST, ("controller",), _R.LOWER, TURNS, _MEASURED,
       stays=Stays.IN_LIMITS),
)  # fmt: skip
