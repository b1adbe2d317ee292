"""Faults of frames, of the CAN bus and of boards, as data."""

from __future__ import annotations

from typing import Final

from pam_sim.faults.fault_kind import (
    BOARD_HEARS_NOTHING,
    MOMENT,
    SENSOR_STOPS,
    SHARE,
    VENT,
    WATCH,
    FaultKind,
    Reaction,
    Stays,
)

_K = FaultKind
_R = Reaction

BUS_AND_BOARD_KINDS: Final = (
    # --- frames on the bus ---
    _K("frames_lost_down", "bus", "some commands to the boards are lost", SHARE,
       (), _R.RIDE, WATCH, "the board's watchdog tolerates fifty lost commands"),
    _K("frames_lost_up", "bus", "some measurements are lost", SHARE,
       ("frames_lost",), _R.RIDE, WATCH),
    _K("all_frames_lost_down", "bus", "nothing reaches the boards", {"duration": (0.3, 1.0)},
       ("board_fault", "WATCHDOG"), _R.VENT, BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("all_frames_lost_up", "bus", "nothing comes from the boards", {"duration": (0.3, 1.0)},
       ("stale_sensor", "controller"), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
    _K("frames_late_down", "bus", "commands arrive late", {"delay": (0.002, 0.006), **MOMENT},
       (), _R.RIDE, WATCH, "within the phase margin of the control loop"),
    _K("frames_late_up", "bus", "measurements arrive late",
       {"delay": (0.002, 0.006), **MOMENT}, (), _R.RIDE, WATCH,
       "within the phase margin of the control loop"),
    _K("frames_very_late_up", "bus", "measurements arrive later than sensor_timeout",
       {"delay": (0.07, 0.3), "duration": (0.5, 1.0)}, ("stale_sensor",), _R.VENT, SENSOR_STOPS,
       "sensor_timeout"),
    _K("frames_repeated_down", "bus", "commands arrive twice", SHARE, (), _R.RIDE, WATCH,
       "the board ignores a command whose counter repeats"),
    _K("frames_repeated_up", "bus", "measurements arrive twice", SHARE,
       ("frames_repeated",), _R.RIDE, WATCH),
    _K("frames_reordered_down", "bus", "commands overtake each other",
       {"delay": (0.0025, 0.005), **SHARE}, (), _R.RIDE, WATCH,
       "an old command acts for one cycle"),
    _K("frames_reordered_up", "bus", "measurements overtake each other",
       {"delay": (0.0025, 0.005), **SHARE}, ("frames_reordered",), _R.RIDE, WATCH),
    _K("frames_corrupted_few", "bus", "single commands fail their checksum",
       {"share": (0.002, 0.006), **MOMENT}, (), _R.RIDE, WATCH,
       "the board counts and drops them"),
    _K("frames_corrupted_many", "bus", "many commands fail their checksum",
       {"share": (0.2, 0.6), "duration": (0.5, 1.0)}, ("board_fault", "CRC"), _R.VENT, 0.2,
       "ten wrong checksums in a second on the board"),
    _K("frames_corrupted_up", "bus", "bits of measurements flip",
       {"share": (0.02, 0.3), "duration": (0.3, 0.8)},
       ("frame_errors", "pressure_rate", "position_jump", "sensor_noise", "over_pressure",
        "frames_reordered", "frames_lost", "position_limit", "sensor_range", "board_fault",
        "board_not_active", "board_restarted", "protocol_version", "supply_low"),
       _R.EITHER, WATCH, "the checksum of CAN rejects such frames; otherwise range, step and "
       "counter show them"),
    _K("frames_wrong_length_down", "bus", "commands of a wrong length", SHARE, (), _R.RIDE,
       WATCH, "the board counts and drops them"),
    _K("frames_wrong_length_up", "bus", "measurements of a wrong length", SHARE,
       ("frame_errors",), _R.RIDE, WATCH),
    _K("frames_foreign", "bus", "another device floods the bus with random frames",
       {"share": (0.2, 0.9), **MOMENT}, ("frame_errors", "board_fault", "board_not_active",
        "board_restarted", "protocol_version", "frames_lost"), _R.EITHER, WATCH,
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
        _K(f"frames_{how}_{way}", "bus", f"{what} {text}", {"delay": (0.001, most)},
           ("loop_too_slow", "joint_too_fast", "pressure_implausible", "controller",
            "stale_sensor"),
           _R.EITHER, 3.0, reason, stays=Stays.TRACKING)
        for way, what in (("down", "commands"), ("up", "measurements"))
        for how, text, most, reason in (
            ("delayed", "arrive late and stay so", 0.08, "the loop bears the delay, or stops"),
            ("jitter", "arrive late, each by another time", 0.03, "the loop bears it, or stops"),
        )
    ),
    _K("measurement_gaps", "bus", "no measurements for a moment, again and again",
       {"gap": (0.015, 0.04), "period": (0.06, 0.2)},
       ("frames_lost", "stale_sensor"), _R.EITHER, 3.0,
       "a gap shorter than sensor_timeout is ridden; many gaps in a second are a fault"),
    _K("measurement_gaps_with_valve_stuck_shut", "bus", "the same, and a valve stays shut",
       {"gap": (0.022, 0.03), "period": (0.06, 0.1)},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 1.5,
       "gaps must not blind the comparison with physics", keeps_air=True),
    _K("measurement_gaps_with_burst", "bus", "the same, and a muscle bursts",
       {"gap": (0.022, 0.03), "period": (0.06, 0.1), "conductance": (4e-9, 1e-8)},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 1.5,
       "gaps must not blind the comparison with physics"),
    # --- boards ---
    _K("board_restart", "board", "a board loses power for a moment", {},
       ("board_not_active", "board_restarted", "board_fault"), _R.VENT, VENT,
       "the board is vented after a restart"),
    _K("board_frozen", "board", "a board's processor hangs until its hardware watchdog resets it; "
       "until then its valves do not move", {"reset_after": (0.02, 0.3)},
       ("stale_sensor", "board_restarted", "board_not_active", "board_lost"), _R.VENT,
       SENSOR_STOPS, "the driver stops after sensor_timeout; the valves vent only with the reset, "
       "since the board receives no frame before", bounds_driver=True),
    _K("counter_jump", "board", "the measurement counter jumps", {"by": (1, 255)},
       ("frames_lost", "frames_repeated", "frames_reordered"), _R.RIDE, WATCH),
    _K("counter_frozen", "board", "the measurement counter no longer changes", {},
       ("counter_frozen", "stale_sensor"), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
)  # fmt: skip
