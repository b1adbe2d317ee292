"""Every fault that can be injected, as data: description, detection, required reaction, time limit.

The table in docs/safety.md is generated from this file (`python -m pam_sim fault-tables
docs/safety.md`), and the fault campaign compares its measurements with the same numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum
from typing import Final

from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import table_as_markdown as states_as_markdown
from pam_driver.safety.states_page import diagram_as_mermaid
from pam_model.errors import PamError

_S: Final = DriverSettings()
WATCHDOG: Final = 0.1  # s, WatchdogTimeout in the DBC
# From detection to vented valves: a cycle of the driver, a frame and a turn of the board, each
# counted twice as a margin [s].
VENT: Final = 0.012
COMMANDS_STOP: Final = _S.command_timeout + VENT
SENSOR_STOPS: Final = _S.sensor_timeout + VENT
BOARD_HEARS_NOTHING: Final = WATCHDOG + 0.010
MARK: Final = "<!-- {} -->"


class Reaction(Enum):
    """The required reaction to a fault; tables show the value."""

    VENT = "vents, latched"
    RIDE = "continues, counted"
    WARN = "continues, warns"
    EITHER = "continues or vents"
    NOTICED = "warns or vents"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind of fault.

    Attributes
    ----------
    name, layer, text : str
        Identifier; where it happens; what happens.
    parameters : mapping of str to (low, high)
        Ranges from which values are drawn uniformly, SI units.
    detected_by : tuple of str
        What may detect it: conditions and counters of the driver, faults of a board, kinds of
        refused commands, "controller".
    reaction : Reaction
        The required reaction.
    bound : float
        Largest time from the fault to vented valves [s]; if the fault must not vent, how long the
        trial observes.
    reason : str
        What determines this bound, or why the fault cannot be detected.
    bounds_driver : bool
        Whether the bound applies to the stop of the driver, since no frame can move the valves.
    to_the_limits : bool
        Whether the joint may leave its reference, within its position limits.
    """

    name: str
    layer: str
    text: str
    parameters: Mapping[str, tuple[float, float]]
    detected_by: tuple[str, ...]
    reaction: Reaction
    bound: float
    reason: str = ""
    bounds_driver: bool = False
    to_the_limits: bool = False


_R = Reaction
_WATCH: Final = 1.0  # s
_K = FaultKind
_MOMENT: Final = {"duration": (0.2, 0.8)}
_SHARE: Final = {"share": (0.05, 0.3), **_MOMENT}

KINDS: Final = (
    # --- frames on the bus ---
    _K("frames_lost_down", "bus", "some commands to the boards are lost", _SHARE,
       (), _R.RIDE, _WATCH, "the board's watchdog tolerates fifty lost commands"),
    _K("frames_lost_up", "bus", "some measurements are lost", _SHARE,
       ("frames_lost",), _R.RIDE, _WATCH),
    _K("all_frames_lost_down", "bus", "nothing reaches the boards", {"duration": (0.3, 1.0)},
       ("board_fault", "WATCHDOG"), _R.VENT, BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("all_frames_lost_up", "bus", "nothing comes from the boards", {"duration": (0.3, 1.0)},
       ("stale_sensor", "controller"), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
    _K("frames_late_down", "bus", "commands arrive late", {"delay": (0.002, 0.006), **_MOMENT},
       (), _R.RIDE, _WATCH, "within the phase margin of the control loop"),
    _K("frames_late_up", "bus", "measurements arrive late",
       {"delay": (0.002, 0.006), **_MOMENT}, (), _R.RIDE, _WATCH,
       "within the phase margin of the control loop"),
    _K("frames_very_late_up", "bus", "measurements arrive later than sensor_timeout",
       {"delay": (0.07, 0.3), "duration": (0.5, 1.0)}, ("stale_sensor",), _R.VENT, SENSOR_STOPS,
       "sensor_timeout"),
    _K("frames_repeated_down", "bus", "commands arrive twice", _SHARE, (), _R.RIDE, _WATCH,
       "the board ignores a command whose counter repeats"),
    _K("frames_repeated_up", "bus", "measurements arrive twice", _SHARE,
       ("frames_repeated",), _R.RIDE, _WATCH),
    _K("frames_reordered_down", "bus", "commands overtake each other",
       {"delay": (0.0025, 0.005), **_SHARE}, (), _R.RIDE, _WATCH,
       "an old command acts for one cycle"),
    _K("frames_reordered_up", "bus", "measurements overtake each other",
       {"delay": (0.0025, 0.005), **_SHARE}, ("frames_reordered",), _R.RIDE, _WATCH),
    _K("frames_corrupted_few", "bus", "single commands fail their checksum",
       {"share": (0.002, 0.006), **_MOMENT}, (), _R.RIDE, _WATCH,
       "the board counts and drops them"),
    _K("frames_corrupted_many", "bus", "many commands fail their checksum",
       {"share": (0.2, 0.6), "duration": (0.5, 1.0)}, ("board_fault", "CRC"), _R.VENT, 0.2,
       "ten wrong checksums in a second on the board"),
    _K("frames_corrupted_up", "bus", "bits of measurements flip",
       {"share": (0.02, 0.3), "duration": (0.3, 0.8)},
       ("frame_errors", "pressure_rate", "position_jump", "sensor_noise", "over_pressure",
        "frames_reordered", "frames_lost", "position_limit", "sensor_range", "board_fault",
        "board_not_active", "board_restarted", "protocol_version", "supply_low"),
       _R.EITHER, _WATCH, "the checksum of CAN rejects such frames; otherwise range, step and "
       "counter show them"),
    _K("frames_wrong_length_down", "bus", "commands of a wrong length", _SHARE, (), _R.RIDE,
       _WATCH, "the board counts and drops them"),
    _K("frames_wrong_length_up", "bus", "measurements of a wrong length", _SHARE,
       ("frame_errors",), _R.RIDE, _WATCH),
    _K("frames_foreign", "bus", "another device floods the bus with random frames",
       {"share": (0.2, 0.9), **_MOMENT}, ("frame_errors", "board_fault", "board_not_active",
        "board_restarted", "protocol_version", "frames_lost"), _R.EITHER, _WATCH,
       "a random frame that is valid is accepted, since a CAN frame does not name its sender"),
    _K("bus_off", "bus", "the CAN controller goes bus-off and recovers",
       {"duration": (0.05, 0.5)}, ("bus_off",), _R.VENT, BOARD_HEARS_NOTHING,
       "detected at once; nothing can be sent, so the board's watchdog vents"),
    _K("bus_down", "bus", "the interface goes down and up", {"duration": (0.05, 0.5)},
       ("bus_down",), _R.VENT, BOARD_HEARS_NOTHING,
       "detected at once; nothing can be sent, so the board's watchdog vents"),
    _K("error_frames", "bus", "error frames, up to error-passive", _MOMENT, ("error_frames",),
       _R.RIDE, _WATCH),
    _K("send_queue_full_short", "bus", "the transmit queue is full for a moment",
       {"duration": (0.01, 0.06)}, ("send_queue_full",), _R.RIDE, _WATCH),
    _K("send_queue_full", "bus", "the transmit queue stays full", {"duration": (0.2, 0.6)},
       ("send_blocked", "board_fault", "send_queue_full"), _R.VENT, BOARD_HEARS_NOTHING,
       "the board's watchdog"),
    _K("two_drivers", "bus", "a second driver starts on the same bus", {},
       ("foreign_command",), _R.VENT, VENT, "one frame of the second driver"),
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
       ("frames_lost", "frames_repeated", "frames_reordered"), _R.RIDE, _WATCH),
    _K("counter_frozen", "board", "the measurement counter no longer changes", {},
       ("counter_frozen", "stale_sensor"), _R.VENT, SENSOR_STOPS, "sensor_timeout"),
    # --- sensors ---
    _K("pressure_stuck", "sensor", "a pressure reading freezes", {},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 2.5,
       "detected when the pressure should change"),
    _K("pressure_noisy", "sensor", "a pressure sensor becomes very noisy",
       {"amplitude": (2e4, 1e5)},
       ("sensor_noise", "pressure_rate", "sensor_range", "over_pressure", "OVER_PRESSURE"),
       _R.VENT, 0.08, "25 samples"),
    _K("pressure_noisier", "sensor", "a pressure sensor becomes noisier",
       {"amplitude": (5.4e3, 6.2e3)}, ("suspected sensor_noise",), _R.WARN, _WATCH),
    _K("pressure_too_high", "sensor", "a pressure sensor is shorted",
       {"shown": (6.7e5, 1.2e6)}, ("over_pressure", "pressure_rate", "OVER_PRESSURE"), _R.VENT,
       VENT, "one sample, on the board and in the driver"),
    _K("pressure_too_low", "sensor", "a pressure sensor shows a vacuum",
       {"shown": (-1e5, -4e4)}, ("sensor_range", "pressure_rate"), _R.VENT, VENT, "one sample"),
    _K("pressure_lost", "sensor", "a pressure sensor is disconnected", {},
       ("board_fault", "SENSOR", "stale_sensor"), _R.VENT, VENT, "one sample, on the board"),
    _K("pressure_drift", "sensor", "a pressure sensor drifts", {"rate": (3e4, 1.5e5)},
       ("torque_implausible", "pressure_implausible", "sensor_range", "over_pressure"), _R.VENT,
       5.6, "detected when the error of the torque exceeds its limit"),
    _K("pressure_offset", "sensor", "a pressure reading jumps", {"by": (6e4, 3e5)},
       ("pressure_rate", "pressure_implausible", "over_pressure", "OVER_PRESSURE"), _R.VENT, VENT,
       "one sample"),
    _K("pressures_swapped", "sensor", "two pressure sensors are exchanged", {},
       ("pressure_rate", "pressure_implausible", "torque_implausible", "sensor_range"), _R.VENT,
       0.5, "detected when the two pressures differ"),
    _K("encoder_stuck", "sensor", "the angle freezes", {},
       ("torque_implausible", "pressure_implausible", "over_pressure"), _R.VENT, 1.0,
       "detected when pressures and angle disagree"),
    _K("encoder_noisy", "sensor", "the encoder becomes noisy", {"amplitude": (0.05, 0.3)},
       ("sensor_noise", "position_jump", "position_limit", "torque_implausible"), _R.VENT, 0.08,
       "25 samples, or sooner, since the noise implies torques that do not exist"),
    _K("encoder_jump", "sensor", "the angle jumps and keeps the offset", {"by": (0.25, 1.0)},
       ("position_jump", "position_limit"), _R.VENT, VENT, "one sample"),
    _K("encoder_drift", "sensor", "the encoder slips", {"rate": (0.2, 1.0)},
       ("torque_implausible", "position_limit", "pressure_implausible"), _R.VENT, 4.0,
       "detected when the error of the torque exceeds its limit"),
    _K("encoder_out_of_range", "sensor", "the encoder shows an impossible angle",
       {"shown": (1.5, 8.0)}, ("position_limit", "position_jump"), _R.VENT, VENT, "one sample"),
    _K("encoder_lost", "sensor", "the encoder is disconnected", {},
       ("board_fault", "SENSOR", "stale_sensor"), _R.VENT, VENT, "one sample, on the board"),
    # --- valves and air ---
    _K("valve_stuck_open", "valve", "a valve stays open to the supply", {},
       ("pressure_implausible", "over_pressure", "torque_implausible", "OVER_PRESSURE"), _R.VENT,
       0.15, "the board commands a vent; only a shut-off valve in the supply can stop the air"),
    _K("valve_stuck_shut", "valve", "a valve stays shut", {},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 1.0,
       "detected when the pressure should change"),
    _K("valve_stuck_exhausting", "valve", "a valve stays open to ambient", {},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 0.2,
       "detected when the pressure falls"),
    _K("muscle_burst", "valve", "a muscle or hose bursts; the hole is at least as large as "
       "the fully open valve", {"conductance": (4e-9, 1e-8)},
       ("pressure_implausible", "torque_implausible"), _R.VENT, 0.4,
       "detected when the pressure falls"),
    _K("muscle_leak", "valve", "a muscle leaks through a smaller hole",
       {"conductance": (1.2e-9, 4e-9)}, ("suspected pressure_implausible", "pressure_implausible"),
       _R.NOTICED, 2.0, "a deviation below the limit is a warning"),
    _K("muscle_leak_small", "valve", "a muscle leaks a little", {"conductance": (1e-10, 1.2e-9)},
       (), _R.RIDE, 2.0, "the valve compensates the leak; the diagnosis of a recording finds it"),
    _K("supply_lost", "valve", "the supply pressure is lost", {"share": (0.0, 0.4)},
       ("supply_low",), _R.VENT, 0.02 + VENT, "the next status"),
    _K("supply_sags", "valve", "the supply pressure falls a little", {"share": (0.6, 0.72)},
       ("suspected supply_low",), _R.WARN, _WATCH),
    # --- host ---
    _K("clock_step", "host", "the wall clock is changed", {"by": (-3600.0, 3600.0)}, (), _R.RIDE,
       _WATCH, "a command in transit may be refused because of its stamp; all other ages are "
       "measured with the monotonic clock"),
    _K("host_stall_short", "host", "the host is stalled for a moment",
       {"duration": (0.005, 0.03)}, (), _R.RIDE, _WATCH, "shorter than every time-out"),
    _K("host_stall", "host", "the host is stalled", {"duration": (0.15, 0.6)},
       ("board_fault", "WATCHDOG", "command_timeout"), _R.VENT, BOARD_HEARS_NOTHING,
       "the board's watchdog"),
    _K("driver_stopped", "host", "the driver is stopped (SIGSTOP) and continued",
       {"duration": (0.15, 0.6)}, ("board_fault", "WATCHDOG", "command_timeout"), _R.VENT,
       BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("driver_killed", "host", "the driver is killed", {}, ("WATCHDOG",), _R.VENT,
       BOARD_HEARS_NOTHING, "the board's watchdog"),
    _K("controller_stopped_short", "host", "the controller is stopped for a moment",
       {"duration": (0.01, 0.05)}, (), _R.RIDE, _WATCH, "shorter than command_timeout"),
    _K("controller_stopped", "host", "the controller is stopped and continued",
       {"duration": (0.15, 0.6)}, ("command_timeout",), _R.VENT, COMMANDS_STOP,
       "command_timeout"),
    _K("controller_killed", "host", "the controller is killed", {}, ("command_timeout",), _R.VENT,
       COMMANDS_STOP, "command_timeout"),
    _K("parameters_nonsense", "host", "the controller is given impossible parameters", {},
       ("refused parameters",), _R.RIDE, 0.3, "each is refused; the previous ones remain valid"),
    _K("references_nonsense", "host", "the controller is given impossible references", {},
       ("refused references",), _R.RIDE, 0.3, "each is refused; the previous ones remain valid"),
    _K("measurements_nonsense", "host", "the controller receives impossible measurements",
       {"duration": (0.15, 0.5)}, ("command_timeout", "controller"), _R.VENT, COMMANDS_STOP,
       "the controller stops, then command_timeout"),
    # --- commands ---
    *(
        _K(f"command_{kind}", "command", text, {"duration": (0.15, 0.5)},
           (refusal, "command_timeout"), _R.VENT, COMMANDS_STOP,
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
    _K("command_some_bad", "command", "some commands are nonsense", _SHARE,
       ("not_finite",), _R.RIDE, _WATCH),
    _K("command_old_between", "command", "old commands arrive from a queue between new ones",
       _SHARE, ("out_of_order",), _R.RIDE, _WATCH),
    _K("command_flood", "command", "fifty times as many commands arrive", _MOMENT, (), _R.RIDE,
       _WATCH, "the latest command is used; there is no queue"),
    _K("command_two_publishers", "command", "a second node publishes commands", _MOMENT,
       ("pressure_implausible", "torque_implausible", "position_limit", "over_pressure"),
       _R.EITHER, _WATCH, "both are valid, so the joint may move anywhere within its limits; "
       "/diagnostics warns of the number of publishers", to_the_limits=True),
    _K("vent_called", "operator", "someone calls ~/vent", {}, ("vented",), _R.VENT, VENT,
       "each board receives a frame before the service returns"),
)  # fmt: skip


def kind_called(name: str) -> FaultKind:
    """The kind with this name; StopIteration if there is none."""
    return next(kind for kind in KINDS if kind.name == name)


def kinds_called(names: Sequence[str] | None, kinds: Sequence[FaultKind]) -> list[FaultKind]:
    """The kinds with these names; all kinds if no names are given.

    Raises
    ------
    PamError
        If no kind has one of the names.
    """
    known = {kind.name: kind for kind in kinds}
    for name in names or ():
        if name not in known:
            close = get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(known)}"
            raise PamError(f"unknown fault {name!r}; {hint}")
    return [kind for kind in kinds if not names or kind.name in names]


def bounds_as_markdown() -> str:
    """The table of faults and bounds as docs/safety.md shows it."""
    lines = ["| fault | what happens | must follow | within | by |", "|---|---|---|---|---|"]
    layer = ""
    for kind in KINDS:
        if kind.layer != layer:
            layer = kind.layer
            lines.append(f"| **{layer}** | | | | |")
        within = f"{1e3 * kind.bound:.0f} ms" if kind.reaction is Reaction.VENT else ""
        cells = (f"`{kind.name}`", kind.text, kind.reaction.value, within, kind.reason)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def write_into(page: str) -> str:
    """The page with updated diagram and tables between their marks.

    Raises
    ------
    PamError
        If a mark is missing.
    """
    parts = {
        "diagram": f"```mermaid\n{diagram_as_mermaid()}\n```",
        "states": states_as_markdown(),
        "faults": bounds_as_markdown(),
    }
    for name, part in parts.items():
        begin, end = MARK.format(f"{name}: begin"), MARK.format(f"{name}: end")
        head, found, rest = page.partition(begin)
        _, ended, tail = rest.partition(end)
        if not found or not ended:
            raise PamError(f"the page has no {begin} ... {end}")
        page = f"{head}{begin}\n{part}\n{end}{tail}"
    return page
