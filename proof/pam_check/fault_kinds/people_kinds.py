"""The operator inputs, pressed, released or without messages while a joint moves, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import BRAKING, VENT, FaultKind, Reaction
from pam_model.rig import People

_K = FaultKind
_R = Reaction
_P: Final = People()
_SILENT: Final = "people.deadline"
_STATUS: Final = 0.02 + VENT  # two periods of the status
HALF_TURN: Final = 0.84  # s, half a period of the campaign's motion

PEOPLE_KINDS: Final = (
    _K("emergency_stop_pressed", "people", "the emergency stop is pressed (topic)", {},
       ("emergency_stop",), _R.VENT, VENT, "the next cycle of the driver"),
    _K("emergency_stop_for_one_message", "people", "the emergency stop is pressed for one message, "
       "permissions follow at once (topic)", {"permissions": (1, 300)}, ("emergency_stop",),
       _R.VENT, VENT, "the next cycle of the driver"),
    _K("emergency_stop_silent", "people", "the emergency stop's topic ends", {},
       ("emergency_stop",), _R.VENT, _P.deadline + VENT, _SILENT),
    _K("enabling_switch_released", "people", "the enabling switch is released (topic)", {}, (),
       _R.VENT, VENT, "the next cycle of the driver; no fault"),
    _K("enabling_switch_for_one_message", "people", "the enabling switch is released for one "
       "message, permissions follow at once (topic)", {"permissions": (1, 300)}, (), _R.VENT, VENT,
       "the next cycle of the driver; no fault"),
    _K("enabling_switch_silent", "people", "the enabling switch's topic ends", {}, (), _R.VENT,
       _P.deadline + VENT, _SILENT),
    _K("enabling_switch_bounces", "people", "the enabling switch bounces (topic)",
       {"period": (0.004, 0.03)}, (), _R.VENT, VENT, "one release counts: nothing moves "
       "again by itself"),
    _K("emergency_stop_while_lowered", "people", "the emergency stop is pressed while ~/vent "
       "lowers the joint (topic)", {"after": (0.02, 0.3)}, ("emergency_stop",), _R.VENT, VENT,
       "the next cycle of the driver"),
    _K("vent_with_inputs_held", "people", "someone calls ~/vent while the emergency stop's topic "
       "permits motion", {}, ("vented",), _R.LOWER, VENT, "lowered to the end: inputs are read "
       "while the joint is lowered"),
    _K("emergency_stop_input_lost", "people", "the board no longer reports its emergency stop", {},
       ("emergency_stop",), _R.VENT, _STATUS, "the next status"),
    _K("enabling_switch_input_lost", "people", "the board no longer reports its enabling switch",
       {}, (), _R.VENT, _STATUS, "the next status; no fault"),
    _K("full_speed_ended", "people", "full speed is no longer permitted (topic)", {},
       ("refused references",), _R.RIDE, 3.0, "the controller brakes and holds, then keeps "
       "reduced_velocity"),
    _K("full_speed_silent", "people", "the topic that permits full speed ends", {},
       ("refused references",), _R.RIDE, 3.0, "as before, after people.deadline"),
    _K("reduced_speed_ignored", "people", "the same, and the controller continues as before", {},
       ("joint_too_fast",), _R.VENT, _P.deadline + _P.slowing_time + HALF_TURN + BRAKING,
       "slowing_time, and until the motion is fast again"),
)  # fmt: skip
