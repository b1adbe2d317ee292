"""The brake and the dump valve at the outputs of a board, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import BOARD_HEARS_NOTHING, VENT, FaultKind, Reaction, Stays

_K = FaultKind
_R = Reaction
_BRAKE: Final = {"torque": (10.0, 60.0)}
_STATUS: Final = 0.02 + VENT  # two periods of the status

OUTPUT_KINDS: Final = (
    _K("brake_engages_at_a_stop", "brake and dump valve", "the driver is killed; the brake holds "
       "the joint with full muscles", _BRAKE, ("WATCHDOG", "HEARTBEAT_LOST"), _R.VENT,
       BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("brake_does_not_engage", "brake and dump valve", "the driver is killed; the brake stays "
       "released", _BRAKE, ("WATCHDOG", "HEARTBEAT_LOST"), _R.VENT, BOARD_HEARS_NOTHING,
       "the board's watchdog; the joint moves as without a brake"),
    _K("brake_engages_in_motion", "brake and dump valve", "the brake loses its current, and the "
       "board does not notice it", _BRAKE, ("torque_implausible", "controller"), _R.EITHER, 3.0,
       "the motion lacks the torque that the brake takes", stays=Stays.TRACKING),
    _K("brake_sticks_then_releases", "brake and dump valve", "the brake engages in motion and "
       "releases after a while", {**_BRAKE, "duration": (0.1, 1.5)},
       ("torque_implausible", "controller"), _R.EITHER, 3.0,
       "as before; the joint must not be thrown when it is free again", stays=Stays.TRACKING),
    _K("dump_valve_stuck_shut", "brake and dump valve", "the driver is killed; the dump valve "
       "stays shut", {}, ("WATCHDOG", "HEARTBEAT_LOST"), _R.VENT, BOARD_HEARS_NOTHING,
       "the board's watchdog; each muscle empties through its own valve"),
    _K("dump_valve_opens_in_motion", "brake and dump valve", "the dump valve loses its current, "
       "and the board does not notice it", {}, ("supply_low",), _R.LOWER, _STATUS,
       "the next status"),
)  # fmt: skip
