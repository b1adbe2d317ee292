"""Injects the faults of the rig: frames, boards, sensors, valves, supply of air.

A stage contains the simulated rig and its bus: either the rig's loop in real time, or the chain of
the campaign. `pam_check.faults.host_faults` injects the faults of the host and of commands.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping

from pam_driver.boards.protocol import Address
from pam_model.errors import PamError
from pam_model.names import unknown
from pam_model.rig import Rig
from pam_ros.foreign_text import shown
from pam_sim import device_fault_injection
from pam_sim.fault_stage import FOR_EVER, FaultStage, Injection, Values
from pam_sim.faults import rig_faults
from pam_sim.faults.frame_faults import Direction, FrameFault
from pam_sim.faults.kinds import ALL_KINDS
from pam_sim.faults.size_of_faults import ranges_on


def _frames(kind: str, direction: Direction) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        until = stage.now + values.get("duration", FOR_EVER)
        stage.frames.faults.append(
            FrameFault(
                kind,
                direction,
                values.get("share", 1.0),
                values.get("delay", values.get("gap", 0.0)),
                until,
                values.get("period", 1.0),
            )
        )

    return inject


def _board(stage: FaultStage, draw: random.Random) -> Address:
    return draw.choice(list(stage.sim.boards))


def _input(stage: FaultStage, draw: random.Random, *, encoder: bool = False) -> tuple[Address, int]:
    """A randomly chosen pressure sensor or encoder."""
    wired = stage.sim.wired
    board = draw.choice(
        [name for name, one in wired.items() if (one.angles if encoder else one.pressures)]
    )
    place = rig_faults.POSITION if encoder else draw.choice(range(len(wired[board].pressures)))
    return board, place


def _restart(stage: FaultStage, values: Values, draw: random.Random) -> None:
    stage.sim.restart_board(_board(stage, draw), stage.now)


def _freeze(stage: FaultStage, values: Values, draw: random.Random) -> None:
    stage.sim.faults.frozen[_board(stage, draw)] = stage.now + values["reset_after"]


def _misbehave(fault: str) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        stage.sim.boards[_board(stage, draw)].misbehave(fault, values.get("by", 0.0))

    return inject


def _sensor(
    make: Callable[[Values, float, random.Random], rig_faults.Reading], *, encoder: bool
) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        place = _input(stage, draw, encoder=encoder)
        stage.sim.faults.sensors[place] = make(values, stage.now, draw)

    return inject


def _swap(stage: FaultStage, values: Values, draw: random.Random) -> None:
    stage.sim.faults.swapped.add(_board(stage, draw))


def _valve(opening: float) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        stage.sim.faults.valves[_input(stage, draw)] = opening

    return inject


def _leak(stage: FaultStage, values: Values, draw: random.Random) -> None:
    stage.sim.open_leak(draw.randrange(len(stage.sim.rig.muscles)), values["conductance"])


def _exhausts(stage: FaultStage, values: Values, draw: random.Random) -> None:
    for address, wired in stage.sim.wired.items():
        for place in range(len(wired.valves)):
            stage.sim.faults.exhausts[address, place] = values["share"]


def _lag(*, encoder: bool) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        for address, wired in stage.sim.wired.items():
            places = [rig_faults.POSITION] if encoder else range(len(wired.pressures))
            for place in places:
                lag = rig_faults.lagging(values["time_constant"])
                stage.sim.faults.sensors[address, place] = lag

    return inject


def _both(*injections: Injection) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        for one in injections:
            one(stage, values, draw)

    return inject


def _supply(stage: FaultStage, values: Values, draw: random.Random) -> None:
    rig = stage.sim.rig
    ambient = rig.gas.ambient_pressure
    stage.sim.set_supply_pressure(ambient + values["share"] * rig.supply_gauge_pressure)


def _signed(draw: random.Random, size: float) -> float:
    return size * draw.choice((-1.0, 1.0))


INJECTIONS: Mapping[str, Injection] = {
    "frames_lost_down": _frames("lost", "down"),
    "frames_lost_up": _frames("lost", "up"),
    "all_frames_lost_down": _frames("lost", "down"),
    "all_frames_lost_up": _frames("lost", "up"),
    "frames_late_down": _frames("late", "down"),
    "frames_late_up": _frames("late", "up"),
    "frames_very_late_up": _frames("late", "up"),
    "frames_repeated_down": _frames("repeated", "down"),
    "frames_repeated_up": _frames("repeated", "up"),
    "frames_replayed_down": _frames("replayed", "down"),
    "frames_replayed_up": _frames("replayed", "up"),
    "frames_reordered_down": _frames("reordered", "down"),
    "frames_reordered_up": _frames("reordered", "up"),
    "frames_corrupted_few": _frames("corrupted", "down"),
    "frames_corrupted_many": _frames("corrupted", "down"),
    "frames_corrupted_up": _frames("corrupted", "up"),
    "frames_wrong_length_down": _frames("wrong_length", "down"),
    "frames_wrong_length_up": _frames("wrong_length", "up"),
    "frames_foreign": _frames("foreign", "up"),
    "frames_delayed_down": _frames("late", "down"),
    "frames_delayed_up": _frames("late", "up"),
    "frames_jitter_down": _frames("jitter", "down"),
    "frames_jitter_up": _frames("jitter", "up"),
    "measurement_gaps": _frames("gaps", "up"),
    "measurement_gaps_with_valve_stuck_shut": _both(_frames("gaps", "up"), _valve(0.0)),
    "measurement_gaps_with_burst": _both(_frames("gaps", "up"), _leak),
    "pressure_sensors_lag": _lag(encoder=False),
    "encoder_lags": _lag(encoder=True),
    "supply_too_high": _supply,
    "exhausts_restricted": _exhausts,
    "board_restart": _restart,
    "board_frozen": _freeze,
    "counter_jump": _misbehave("counter_jump"),
    "counter_frozen": _misbehave("counter_frozen"),
    "not_available_between": _misbehave("not_available_between"),
    "pressure_stuck": _sensor(lambda v, t, d: rig_faults.stuck(), encoder=False),
    "pressure_noisy": _sensor(
        lambda v, t, d: rig_faults.noisy(v["amplitude"], d.randrange(1 << 30)), encoder=False
    ),
    "pressure_noisier": _sensor(
        lambda v, t, d: rig_faults.noisy(v["amplitude"], d.randrange(1 << 30)), encoder=False
    ),
    "pressure_too_high": _sensor(lambda v, t, d: rig_faults.constant(v["shown"]), encoder=False),
    "pressure_too_low": _sensor(lambda v, t, d: rig_faults.constant(v["shown"]), encoder=False),
    "pressure_lost": _sensor(lambda v, t, d: rig_faults.constant(math.nan), encoder=False),
    "pressure_drift": _sensor(
        lambda v, t, d: rig_faults.drifting(_signed(d, v["rate"]), t), encoder=False
    ),
    "pressure_offset": _sensor(
        lambda v, t, d: rig_faults.offset(_signed(d, v["by"])), encoder=False
    ),
    "pressures_swapped": _swap,
    "encoder_stuck": _sensor(lambda v, t, d: rig_faults.stuck(), encoder=True),
    "encoder_noisy": _sensor(
        lambda v, t, d: rig_faults.noisy(v["amplitude"], d.randrange(1 << 30)), encoder=True
    ),
    "encoder_jump": _sensor(lambda v, t, d: rig_faults.offset(_signed(d, v["by"])), encoder=True),
    "encoder_drift": _sensor(
        lambda v, t, d: rig_faults.drifting(_signed(d, v["rate"]), t), encoder=True
    ),
    "encoder_out_of_range": _sensor(
        lambda v, t, d: rig_faults.constant(_signed(d, v["shown"])), encoder=True
    ),
    "encoder_lost": _sensor(lambda v, t, d: rig_faults.constant(math.nan), encoder=True),
    "valve_stuck_open": _valve(1.0),
    "valve_stuck_shut": _valve(0.0),
    "valve_stuck_exhausting": _valve(-1.0),
    "muscle_burst": _leak,
    "muscle_leak": _leak,
    "muscle_leak_small": _leak,
    "supply_lost": _supply,
    "supply_sags": _supply,
    **device_fault_injection.INJECTIONS,
}


def parse_injection(text: str, rig: Rig) -> tuple[str, dict[str, float]]:
    """Read `name value=0.3 duration=1`; a missing value is the middle of its range on this rig.

    Raises
    ------
    PamError
        For an unknown fault or value, or a value that is not a number.
    """
    name, *pairs = text.split()[:16] or [""]
    if name not in INJECTIONS:
        raise PamError(unknown("fault", name, INJECTIONS))
    kind = next(kind for kind in ALL_KINDS if kind.name == name)
    values = {key: 0.5 * (low + high) for key, (low, high) in ranges_on(kind, rig).items()}
    for pair in pairs:
        key, _, number = pair.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if key not in values or not math.isfinite(value):
            raise PamError(
                f"fault {name}: {shown(pair)}: expected "
                f"{' or '.join(f'{key}=NUMBER' for key in values) or 'no value'}"
            )
        values[key] = value
    return name, values


def inject(stage: FaultStage, name: str, values: Values, draw: random.Random) -> None:
    """Inject a fault now; UnknownNameError for a fault that is not one of the rig."""
    INJECTIONS[name](stage, values, draw)


def mend(stage: FaultStage) -> None:
    """End every fault that can end."""
    stage.frames.faults.clear()
    stage.sim.faults.clear()
    for index in range(len(stage.sim.rig.muscles)):
        stage.sim.open_leak(index, 0.0)
    stage.sim.set_supply_pressure(stage.sim.rig.supply_pressure)
    for board in stage.sim.boards.values():
        board.misbehave("mended", 0.0)
