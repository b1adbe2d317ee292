"""Faults of devices that are no board of this project, as data: mapped ones and CANopen.

Some faults of the other layers hold for every kind of board as well (`FOR_ALL_BOARDS`). The others
are stated for the board of this project, since they rest on what it promises: counters and
checksums in its frames, the events of its state machine, the physics of its flow valves.
"""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import (
    BOARD_HEARS_NOTHING,
    SENSOR_STOPS,
    VENT,
    FaultKind,
    Reaction,
    of_rig,
)
from pam_driver.boards.canopen.board import HEARTBEATS_MISSED
from pam_driver.driver_settings import DriverSettings

_K = FaultKind
_VENT = Reaction.VENT
_CANOPEN, _MAPPED = ("canopen",), ("mapped",)
HEARTBEAT_PERIOD: Final = 0.05
"""Time between two heartbeats of a CANopen device, by default [s]."""
_HEARTBEAT_STOPS: Final = HEARTBEATS_MISSED * HEARTBEAT_PERIOD + VENT
_STATUS_STOPS: Final = DriverSettings().board_timeout + VENT

DEVICE_KINDS: Final = (
    of_rig("device_unplugged", "device", "a device is taken off the bus and keeps its power",
       ("board_lost", "stale_sensor", "board_fault"), _VENT, BOARD_HEARS_NOTHING,
       "without its measurements the driver vents after sensor_timeout; a device with valves "
       "receives no more commands and vents by its watchdog", boards=(*_MAPPED, *_CANOPEN),
       message=r"board \w+: (node \d+: )?no \w+"),
    # --- CANopen ---
    of_rig("canopen_reboots", "device", "a CANopen device loses power for a moment",
       ("board_restarted", "stale_sensor", "board_lost"), _VENT, SENSOR_STOPS,
       "its outputs have no power; the driver stops at its boot-up, or after sensor_timeout",
       boards=_CANOPEN, message=r"board \w+: node \d+ has restarted \(boot-up\)"),
    of_rig("canopen_emergency", "device", "a CANopen device reports an error (EMCY)",
       ("board_fault",), _VENT, VENT, "the frame of the error", boards=_CANOPEN,
       message=r"board \w+: fault: node \d+: EMCY 0x[1-8][0-9A-F]{3}, "),
    of_rig("canopen_stops_by_itself", "device", "a CANopen device stops without giving a reason",
       ("stale_sensor", "board_fault"), _VENT, SENSOR_STOPS,
       "its next heartbeat shows its state, and its measurements stop", boards=_CANOPEN,
       message=r"board \w+: fault: node \d+ left the state operational: stopped"),
    of_rig("canopen_heartbeat_lost", "device",
       "the heartbeat of a CANopen device stops, its PDOs do " "not", ("board_lost",), _VENT,
       _HEARTBEAT_STOPS, "five missing heartbeats", boards=_CANOPEN,
       message=r"board \w+: node \d+: no heartbeat \(0x7[0-9A-F]{2}\)"),
    of_rig("canopen_host_heartbeat_lost", "device",
       "the driver's heartbeat does not arrive, its set " "points do", ("board_fault",), _VENT,
       BOARD_HEARS_NOTHING, "the watchdog of the device (0x1016); its EMCY stops the driver",
       boards=_CANOPEN,
       message=r"board \w+: fault: node \d+: EMCY 0x8130, heartbeat of the host lost"),
    of_rig("canopen_refuses_an_object", "device",
       "a CANopen device restarts, then refuses an object " "of its configuration (SDO abort)",
       ("board_restarted", "stale_sensor"), _VENT, SENSOR_STOPS,
       "as a restart; there is no activation before it accepts", boards=_CANOPEN,
       message=r"board \w+: fault: node \d+, writing 0x1017:0 \(.*\): abort code 0x08000020, "),
    of_rig("canopen_answers_no_sdo", "device", "a CANopen device restarts, then answers no SDO "
       "request", ("board_restarted", "stale_sensor"), _VENT, SENSOR_STOPS,
       "as a restart; there is no activation before it answers", boards=_CANOPEN,
       message=r"board \w+: .*node \d+.*0x1[0-9A-F]{3}:\d.*no answer within 3 times"),
    of_rig("canopen_measurements_wrong_length", "device",
       "the measurements of a CANopen device have a " "wrong length (PDO)", ("stale_sensor",),
       _VENT, SENSOR_STOPS, "they are refused, then sensor_timeout", boards=_CANOPEN,
       message=r"TPDO\d of node \d+ \(0x[0-9A-F]{4}.*\) has \d bytes, expected \d"),
    of_rig("canopen_set_points_wrong_length", "device",
       "the set points of a CANopen device arrive " "with a wrong length (PDO)", ("board_fault",),
       _VENT, VENT, "its EMCY; the driver stops a device (NMT) that does not take its set points",
       boards=_CANOPEN, message=r"board \w+: fault: node \d+: EMCY 0x82[12]0, PDO "),
    of_rig("canopen_other_device", "device",
       "a CANopen device restarts as another one: the EDS file " "is wrong", ("board_restarted",
       "stale_sensor"), _VENT, SENSOR_STOPS, "as a restart; the device is refused",
       boards=_CANOPEN,
       message=r"board \w+: fault: node \d+, object 0x1000:0 \(device profile by \w+\.eds\) is "
       r"0x[0-9A-F]+, expected 0x[0-9A-F]+"),
    # --- mapped ---
    of_rig("mapped_reboots", "device", "a mapped device loses power for a moment",
       ("board_restarted", "stale_sensor", "board_not_active"), _VENT, SENSOR_STOPS,
       "its valves vent at once; the driver stops at its next frame", boards=_MAPPED,
       message=r"board \w+: (has restarted|is \w+ although it was commanded to be active)"),
    of_rig("mapped_reports_a_fault", "device", "a mapped device reports a fault", ("board_fault",),
       _VENT, VENT, "the next frame with its state", boards=_MAPPED, message=r"board \w+: fault: "),
    of_rig("mapped_status_lost", "device", "the message with the state of a mapped device stops",
       ("board_lost",), _VENT, _STATUS_STOPS, "board_timeout", boards=_MAPPED,
       message=r"board \w+: no \w+ for 0\.5 s"),
    of_rig("mapped_measurements_wrong_length", "device",
       "the measurements of a mapped device have a " "wrong length", ("stale_sensor",), _VENT,
       SENSOR_STOPS, "they are refused, then sensor_timeout", boards=_MAPPED,
       message=r"\w+ of board \w+ has \d bytes, expected \d"),
    of_rig("mapped_set_points_wrong_length", "device",
       "the set points of a mapped device arrive with " "a wrong length", ("board_fault",
       "WATCHDOG"), _VENT, BOARD_HEARS_NOTHING, "it refuses them; its watchdog", boards=_MAPPED,
       message=r"board \w+: fault: .*watchdog"),
    of_rig("mapped_other_byte_order", "device",
       "the measurements of a mapped device have another byte " "order: the DBC file is wrong",
       ("stale_sensor", "pressure_rate", "sensor_range", "over_pressure", "position_limit",
       "position_jump", "torque_implausible", "pressure_implausible"), _VENT, SENSOR_STOPS,
       "values outside the range of the DBC file are refused, others are jumps", boards=_MAPPED,
       message=r"\w+\.\w+ of board \w+ is \S+ raw, expected |(pressure|angle) "),
    of_rig("mapped_other_checksum", "device", "the measurements of a mapped device have another "
       "checksum: the DBC file or the rig file is wrong", ("stale_sensor",), _VENT, SENSOR_STOPS,
       "they are refused, then sensor_timeout", boards=_MAPPED,
       message=r"\w+ of board \w+ fails its checksum"),
)  # fmt: skip

FOR_ALL_BOARDS: Final = (
    "all_frames_lost_down", "all_frames_lost_up", "bus_off", "bus_down", "pressure_lost",
    "encoder_lost", "driver_killed", "driver_stopped", "controller_killed", "controller_stopped",
    "vent_called",
)  # fmt: skip
"""Kinds of the other layers that hold whatever the boards are."""
