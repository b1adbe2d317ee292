"""Faults of time, as data: late messages, clocks that stop or are set, processes that pause."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import COMMANDS_STOP, SENSOR_STOPS, FaultKind, Reaction, Stays

_K = FaultKind
_R = Reaction
_LATE: Final = {"delay": (0.001, 0.08)}
_PAUSE: Final = {"gap": (0.01, 0.04), "period": (0.06, 0.2)}
_FOUND: Final = ("loop_too_slow", "joint_too_fast", "pressure_implausible", "controller",
                 "command_timeout")  # fmt: skip

TIME_KINDS: Final = (
    *(
        _K(f"{topic}_{how}", "time", f"{topic} {text} between the processes",
           _LATE if how == "delayed" else {"delay": (0.001, 0.03)}, _FOUND, _R.EITHER, 3.0,
           "their stamps show their age; the loop tolerates it, or stops", stays=Stays.TRACKING)
        for topic in ("commands", "measurements")
        for how, text in (("delayed", "are late"), ("jitter", "are late, each by a different time"))
    ),
    _K("clock_stops_while_silent", "time", "the wall clock stops and so do the measurements", {},
       ("controller", "command_timeout"), _R.LOWER, SENSOR_STOPS + COMMANDS_STOP,
       "ages grow by the monotonic clock: stale_after of the controller, then command_timeout"),
    _K("clock_step_while_silent", "time", "the wall clock is changed and the measurements stop",
       {"by": (-3600.0, 3600.0)}, ("controller", "command_timeout"), _R.LOWER,
       SENSOR_STOPS + COMMANDS_STOP, "stale_after of the controller, then command_timeout"),
    _K("clock_set_back_while_silent", "time", "the wall clock runs backwards and the measurements "
       "stop", {"duration": (0.2, 0.6)}, ("controller", "command_timeout"), _R.LOWER,
       SENSOR_STOPS + COMMANDS_STOP, "stale_after of the controller, then command_timeout"),
    _K("commands_without_stamps_stop", "time", "commands carry no stamp, then they stop", {},
       ("command_timeout",), _R.LOWER, COMMANDS_STOP,
       "the age of a command without a stamp counts from its arrival"),
    *(
        _K(f"{who}_pauses", "time", f"{text} for a moment, again and again", _PAUSE,
           ("loop_too_slow", "joint_too_fast", "controller", "command_timeout"),
           _R.EITHER, 3.0, "each pause is shorter than every time-out; the controller stops when "
           "it stands still for 30 % of the time", stays=Stays.TRACKING)
        for who, text in (("host", "the host pauses"), ("driver", "the driver pauses"),
                          ("controller", "the controller pauses"))
    ),
)  # fmt: skip
