"""Faults of the host and of commands, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import (
    BOARD_HEARS_NOTHING,
    COMMANDS_STOP,
    VENT,
    WATCH,
    FaultKind,
    Reaction,
)
from pam_sim.fault_injection import MOMENT, SHARE

_K = FaultKind
_R = Reaction
# Three commands of two publishers at 500 Hz, each up to 4 ms on its way.
TURNS: Final = 0.01 + VENT

HOST_AND_COMMAND_KINDS: Final = (
    # --- host ---
    _K("clock_step", "host", "the wall clock is changed", {"by": (-3600.0, 3600.0)}, (), _R.RIDE,
       WATCH, "a command in transit may be refused because of its stamp; all other ages are "
       "measured with the monotonic clock"),
    _K("host_stall_short", "host", "the host is stalled for a moment",
       {"duration": (0.005, 0.03)}, (), _R.RIDE, WATCH, "shorter than every time-out"),
    _K("host_stall", "host", "the host is stalled", {"duration": (0.15, 0.6)},
       ("board_fault", "WATCHDOG", "command_timeout"), _R.VENT, BOARD_HEARS_NOTHING,
       "the board's watchdog"),
    _K("driver_stopped", "host", "the driver is stopped (SIGSTOP) and continued",
       {"duration": (0.15, 0.6)}, ("board_fault", "WATCHDOG", "command_timeout"), _R.VENT,
       BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("driver_killed", "host", "the driver is killed", {},
       ("WATCHDOG", "HEARTBEAT_LOST"), _R.VENT, BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("controller_stopped_short", "host", "the controller is stopped for a moment",
       {"duration": (0.01, 0.05)}, (), _R.RIDE, WATCH, "shorter than command_timeout"),
    _K("controller_stopped", "host", "the controller is stopped and continued",
       {"duration": (0.15, 0.6)}, ("command_timeout",), _R.LOWER, COMMANDS_STOP,
       "command_timeout"),
    _K("controller_killed", "host", "the controller is killed", {}, ("command_timeout",), _R.LOWER,
       COMMANDS_STOP, "command_timeout"),
    _K("parameters_nonsense", "host", "the controller is given impossible parameters", {},
       ("refused parameters",), _R.RIDE, 0.3, "each is refused; the previous ones remain valid"),
    _K("references_nonsense", "host", "the controller is given impossible references", {},
       ("refused references",), _R.RIDE, 0.3, "each is refused; the previous ones remain valid"),
    _K("measurements_nonsense", "host", "the controller receives impossible measurements",
       {"duration": (0.15, 0.5)}, ("command_timeout", "controller"), _R.LOWER, COMMANDS_STOP,
       "the controller stops, then command_timeout"),
    # --- commands ---
    *(
        _K(f"command_{kind}", "command", text, {"duration": (0.15, 0.5)},
           (refusal, "command_timeout"), _R.LOWER, COMMANDS_STOP,
           "each is refused, then command_timeout")
        for kind, text, refusal in (
            ("nan", "commands are NaN", "not_finite"),
            ("infinite", "commands are infinite", "not_finite"),
            ("out_of_range", "commands are out of range", "out_of_range"),
            ("wrong_size", "commands have the wrong number of values", "size"),
            ("unknown_name", "commands name an unknown muscle", "name"),
            ("name_twice", "commands name a muscle twice", "name"),
            ("wrong_field", "commands use the wrong field", "field"),
            ("stale", "commands are older than command_timeout", "old"),
            ("future", "commands are stamped in the future", "stamp"),
        )
    ),
    _K("command_some_bad", "command", "some commands are nonsense", SHARE,
       ("not_finite",), _R.RIDE, WATCH),
    _K("command_old_between", "command", "old commands arrive from a queue between new ones",
       SHARE, ("out_of_order",), _R.RIDE, WATCH),
    _K("command_flood", "command", "fifty times as many commands arrive", MOMENT, (), _R.RIDE,
       WATCH, "the latest command is used; there is no queue"),
    _K("command_two_publishers", "command", "a second node publishes commands", MOMENT,
       ("two_publishers",), _R.LOWER, TURNS, "the third command, since the sources of commands "
       "take turns"),
)  # fmt: skip
