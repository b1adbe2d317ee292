"""Every fault that can be injected, as data: description, detection, required reaction, time limit.

The table in docs/safety_tables.md is generated from this file (`pam check pages`), and the fault
campaign compares its measurements with the same numbers.
"""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.bus_and_board_kinds import BUS_AND_BOARD_KINDS
from pam_check.fault_kinds.device_kinds import DEVICE_KINDS
from pam_check.fault_kinds.foreign_kinds import FOREIGN_KINDS
from pam_check.fault_kinds.host_and_command_kinds import HOST_AND_COMMAND_KINDS
from pam_check.fault_kinds.operator_kinds import HIDDEN_KINDS, OPERATOR_KINDS, while_held
from pam_check.fault_kinds.output_kinds import OUTPUT_KINDS
from pam_check.fault_kinds.people_kinds import PEOPLE_KINDS
from pam_check.fault_kinds.reference_kinds import REFERENCE_KINDS
from pam_check.fault_kinds.sensor_and_valve_kinds import SENSOR_AND_VALVE_KINDS
from pam_check.fault_kinds.time_kinds import TIME_KINDS

# faults that are injected a second time while the joint is held away from its rest position
HELD: Final = (
    "encoder_lost", "pressure_lost", "board_restart", "supply_lost", "valve_stuck_open",
    "muscle_burst", "driver_killed", "controller_killed", "all_frames_lost_down",
)  # fmt: skip
_PLAIN: Final = (*BUS_AND_BOARD_KINDS, *SENSOR_AND_VALVE_KINDS, *HOST_AND_COMMAND_KINDS)
ALL_KINDS: Final = (
    *_PLAIN,
    *TIME_KINDS,
    *FOREIGN_KINDS,
    *REFERENCE_KINDS,
    *OPERATOR_KINDS,
    *PEOPLE_KINDS,
    *OUTPUT_KINDS,
    *while_held(_PLAIN, HELD),
    *HIDDEN_KINDS,
    *DEVICE_KINDS,
)
KINDS: Final = tuple(kind for kind in ALL_KINDS if not kind.boards)
"""The kinds that are stated for the board of this project."""
