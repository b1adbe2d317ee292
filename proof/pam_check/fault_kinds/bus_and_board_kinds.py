"""Faults of frames, of the CAN bus and of boards, as data."""

from __future__ import annotations

from typing import Final

from pam_check.fault_kinds.fault_kind import (
    BOARD_HEARS_NOTHING,
    SENSOR_STOPS,
    VENT,
    WATCH,
    FaultKind,
    Reaction,
    Stays,
    of_rig,
)
from pam_sim.fault_injection import MOMENT

_K = FaultKind
_R = Reaction

BUS_AND_BOARD_KINDS: Final = (
    # --- frames on the bus ---
    of_rig("frames_lost_down", "bus", "some commands to the boards are lost", (), _R.RIDE, WATCH,
       "the board's watchdog tolerates fifty lost commands"),
    of_rig("frames_lost_up", "bus", "some measurements are lost", ("frames_lost",), _R.RIDE, WATCH),
    of_rig("all_frames_lost_down", "bus", "nothing reaches the boards", ("board_fault",
       "WATCHDOG"), _R.VENT, BOARD_HEARS_NOTHING, "the board's watchdog"),
    of_rig("all_frames_lost_up", "bus", "nothing comes from the boards", ("stale_sensor",
       "controller"), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
    of_rig("frames_late_down", "bus", "commands arrive late", (), _R.RIDE, WATCH,
       "within the phase margin of the control loop"),
    of_rig("frames_late_up", "bus", "measurements arrive late", (), _R.RIDE, WATCH,
       "within the phase margin of the control loop"),
    of_rig("frames_very_late_up", "bus", "measurements arrive later than sensor_timeout",
       ("stale_sensor",), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
    of_rig("frames_repeated_down", "bus", "commands arrive twice", (), _R.RIDE, WATCH,
       "the board ignores a command whose counter repeats"),
    of_rig("frames_repeated_up", "bus", "measurements arrive twice", ("frames_repeated",), _R.RIDE,
       WATCH),
    of_rig("frames_replayed_down", "bus", "commands arrive again, much later, between new ones",
       ("command_not_heard", "loop_too_slow", "joint_too_fast", "pressure_implausible",
       "torque_implausible", "controller"), _R.EITHER, 3.0, "the board follows both in turns",
       stays=Stays.TRACKING),
    of_rig("frames_replayed_up", "bus", "measurements arrive again, much later, between new ones",
       ("frames_reordered", "frames_lost", "frames_repeated"), _R.EITHER, WATCH,
       "counters and steps of the measurements"),
    of_rig("frames_reordered_down", "bus", "commands overtake each other", (), _R.RIDE, WATCH,
       "an old command acts for one cycle"),
    of_rig("frames_reordered_up", "bus", "measurements overtake each other", ("frames_reordered",),
       _R.RIDE, WATCH),
    of_rig("frames_corrupted_few", "bus", "single commands fail their checksum", (), _R.RIDE,
       WATCH, "the board counts and drops them"),
    of_rig("frames_corrupted_many", "bus", "many commands fail their checksum", ("board_fault",
       "CRC"), _R.VENT, 0.2, "ten wrong checksums in a second on the board"),
    of_rig("frames_corrupted_up", "bus", "bits of measurements flip", ("frame_errors",
       "pressure_rate", "position_jump", "sensor_noise", "over_pressure", "frames_reordered",
       "frames_lost", "position_limit", "sensor_range", "board_fault", "board_not_active",
       "board_restarted", "protocol_version", "supply_low"), _R.EITHER, WATCH,
       "the checksum of CAN rejects such frames; otherwise range, step and " "counter show them"),
    of_rig("frames_wrong_length_down", "bus", "commands of a wrong length", (), _R.RIDE, WATCH,
       "the board counts and drops them"),
    of_rig("frames_wrong_length_up", "bus", "measurements of a wrong length", ("frame_errors",),
       _R.RIDE, WATCH),
    of_rig("frames_foreign", "bus", "another device floods the bus with random frames",
       ("frame_errors", "board_fault", "board_not_active", "board_restarted", "protocol_version",
       "frames_lost"), _R.EITHER, WATCH,
       "a random frame that is valid is accepted, since a CAN frame does not name its sender"),
    _K("bus_off", "bus", "the CAN controller goes bus-off and recovers",
       {"duration": (0.05, 0.5)}, ("bus_off",), _R.VENT, BOARD_HEARS_NOTHING,
       "detected at once; nothing can be sent, so the board's watchdog vents"),
    _K("bus_down", "bus", "the interface goes down and up", {"duration": (0.05, 0.5)},
       ("bus_down",), _R.VENT, BOARD_HEARS_NOTHING,
       "detected at once; nothing can be sent, so the board's watchdog vents"),
    _K("error_frames", "bus", "error frames, up to error-passive", MOMENT, ("error_frames",),
       _R.RIDE, WATCH),
    _K("send_queue_full_short", "bus", "the transmit queue is full for a moment",
       {"duration": (0.01, 0.06)}, ("send_queue_full",), _R.RIDE, WATCH),
    _K("send_queue_full", "bus", "the transmit queue stays full", {"duration": (0.2, 0.6)},
       ("send_blocked", "board_fault", "send_queue_full"), _R.VENT, BOARD_HEARS_NOTHING,
       "the board's watchdog"),
    _K("two_drivers", "bus", "a second driver starts on the same bus", {},
       ("foreign_command",), _R.VENT, VENT, "one frame of the second driver"),
    *(
        of_rig(f"frames_{how}_{way}", "bus", f"{what} {text}",
           ("loop_too_slow", "joint_too_fast", "pressure_implausible", "controller",
            "stale_sensor"),
           _R.EITHER, 3.0, reason, stays=Stays.TRACKING)
        for way, what in (("down", "commands"), ("up", "measurements"))
        for how, text, reason in (
            ("delayed", "arrive late and stay so", "the loop tolerates the delay, or stops"),
            ("jitter", "arrive late, each by a different time",
             "the loop tolerates it, or stops"),
        )
    ),
    of_rig("measurement_gaps", "bus", "no measurements for a moment, again and again",
       ("frames_lost", "stale_sensor"), _R.EITHER, 3.0,
       "a gap shorter than sensor_timeout is bridged; many gaps in a second are a fault"),
    of_rig("measurement_gaps_with_valve_stuck_shut", "bus", "the same, and a valve stays shut",
       ("pressure_implausible", "torque_implausible"), _R.VENT, 1.5,
       "gaps must not blind the comparison with physics", keeps_air=True),
    of_rig("measurement_gaps_with_burst", "bus", "the same, and a muscle bursts",
       ("pressure_implausible", "torque_implausible"), _R.VENT, 1.5,
       "gaps must not blind the comparison with physics", air_drives=True),
    # --- boards ---
    of_rig("board_restart", "board", "a board loses power for a moment", ("board_not_active",
       "board_restarted", "board_fault"), _R.VENT, VENT, "the board is vented after a restart"),
    _K("board_restarts_again_and_again", "board", "a board loses power every moment; someone "
       "clears and activates", {"period": (0.1, 0.6)}, ("board_restarted", "board_not_active"),
       _R.EITHER, 3.0, "each restart vents; no step of the valves between them",
       stays=Stays.TRACKING),
    of_rig("board_frozen", "board",
       "a board's processor hangs until its hardware watchdog resets it; "
       "until then its valves do not move", ("stale_sensor", "board_restarted", "board_not_active",
       "board_lost"), _R.VENT, SENSOR_STOPS,
       "the driver stops after sensor_timeout; the valves vent only with the reset, "
       "since the board receives no frame before", bounds_driver=True),
    of_rig("counter_jump", "board", "the measurement counter jumps", ("frames_lost",
       "frames_repeated", "frames_reordered"), _R.RIDE, WATCH),
    of_rig("counter_frozen", "board", "the measurement counter no longer changes",
       ("counter_frozen", "stale_sensor"), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
    of_rig("not_available_between", "board",
       "another device says \"not available\" under the board's "
       "identifier, after each of its measurements", ("sensor_intermittent",), _R.VENT,
       SENSOR_STOPS, "a share of sensor_timeout in a second"),
)  # fmt: skip
