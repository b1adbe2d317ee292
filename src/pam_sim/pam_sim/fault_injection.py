"""Injects the faults of the rig: frames, boards, sensors, valves, supply of air.

A stage contains the simulated rig and its bus: either the rig's loop in real time, or the chain of
the campaign. `pam_check.faults.host_faults` injects the faults of the host and of commands.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, NamedTuple

from pam_driver.boards.protocol import Address
from pam_model.errors import PamError
from pam_model.names import unknown
from pam_model.rig import Rig
from pam_ros.foreign_text import shown
from pam_sim import device_fault_injection
from pam_sim.fault_stage import FOR_EVER, FaultStage, Injection, Values
from pam_sim.faults import rig_faults
from pam_sim.faults.frame_faults import Direction, FrameFault
from pam_sim.faults.rig_faults import Reading
from pam_sim.faults.size_of_faults import Ranges, ranges_on

MOMENT: Final[Ranges] = {"duration": (0.2, 0.8)}
SHARE: Final[Ranges] = {"share": (0.05, 0.3), **MOMENT}
_GAPS: Final[Ranges] = {"gap": (0.022, 0.03), "period": (0.06, 0.1)}
_Make = Callable[[Values, float, random.Random], Reading]


class RigFault(NamedTuple):
    """A fault that the simulated rig brings about."""

    inject: Injection
    ranges: Ranges = {}  # noqa: RUF012  (read only): of its numbers, SI units


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


def _sensor(make: _Make, encoder: bool) -> Injection:
    def inject(stage: FaultStage, values: Values, draw: random.Random) -> None:
        place = _input(stage, draw, encoder=encoder)
        stage.sim.faults.sensors[place] = make(values, stage.now, draw)

    return inject


_pressure, _encoder = partial(_sensor, encoder=False), partial(_sensor, encoder=True)


def _signed(draw: random.Random, size: float) -> float:
    return size * draw.choice((-1.0, 1.0))


def _stuck(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.stuck()


def _lost(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.constant(math.nan)


def _noisy(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.noisy(values["amplitude"], draw.randrange(1 << 30))


def _constant(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.constant(values["shown"])


def _constant_either_way(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.constant(_signed(draw, values["shown"]))


def _offset(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.offset(_signed(draw, values["by"]))


def _drifting(values: Values, now: float, draw: random.Random) -> Reading:
    return rig_faults.drifting(_signed(draw, values["rate"]), now)


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


FAULTS: Mapping[str, RigFault] = {
    "frames_lost_down": RigFault(_frames("lost", "down"), SHARE),
    "frames_lost_up": RigFault(_frames("lost", "up"), SHARE),
    "all_frames_lost_down": RigFault(_frames("lost", "down"), {"duration": (0.3, 1.0)}),
    "all_frames_lost_up": RigFault(_frames("lost", "up"), {"duration": (0.3, 1.0)}),
    "frames_late_down": RigFault(_frames("late", "down"), {"delay": (0.002, 0.006), **MOMENT}),
    "frames_late_up": RigFault(_frames("late", "up"), {"delay": (0.002, 0.006), **MOMENT}),
    "frames_very_late_up": RigFault(
        _frames("late", "up"), {"delay": (0.07, 0.3), "duration": (0.5, 1.0)}),
    "frames_repeated_down": RigFault(_frames("repeated", "down"), SHARE),
    "frames_repeated_up": RigFault(_frames("repeated", "up"), SHARE),
    "frames_replayed_down": RigFault(_frames("replayed", "down"), {"delay": (0.1, 1.0), **MOMENT}),
    "frames_replayed_up": RigFault(_frames("replayed", "up"), {"delay": (0.1, 1.0), **MOMENT}),
    "frames_reordered_down": RigFault(
        _frames("reordered", "down"), {"delay": (0.0025, 0.005), **SHARE}),
    "frames_reordered_up": RigFault(
        _frames("reordered", "up"), {"delay": (0.0025, 0.005), **SHARE}),
    "frames_corrupted_few": RigFault(
        _frames("corrupted", "down"), {"share": (0.002, 0.006), **MOMENT}),
    "frames_corrupted_many": RigFault(
        _frames("corrupted", "down"), {"share": (0.2, 0.6), "duration": (0.5, 1.0)}),
    "frames_corrupted_up": RigFault(
        _frames("corrupted", "up"), {"share": (0.02, 0.3), "duration": (0.3, 0.8)}),
    "frames_wrong_length_down": RigFault(_frames("wrong_length", "down"), SHARE),
    "frames_wrong_length_up": RigFault(_frames("wrong_length", "up"), SHARE),
    "frames_foreign": RigFault(_frames("foreign", "up"), {"share": (0.2, 0.9), **MOMENT}),
    "frames_delayed_down": RigFault(_frames("late", "down"), {"delay": (0.001, 0.08)}),
    "frames_delayed_up": RigFault(_frames("late", "up"), {"delay": (0.001, 0.08)}),
    "frames_jitter_down": RigFault(_frames("jitter", "down"), {"delay": (0.001, 0.03)}),
    "frames_jitter_up": RigFault(_frames("jitter", "up"), {"delay": (0.001, 0.03)}),
    "measurement_gaps": RigFault(
        _frames("gaps", "up"), {"gap": (0.015, 0.04), "period": (0.06, 0.2)}),
    "measurement_gaps_with_valve_stuck_shut": RigFault(
        _both(_frames("gaps", "up"), _valve(0.0)), _GAPS),
    "measurement_gaps_with_burst": RigFault(
        _both(_frames("gaps", "up"), _leak), {**_GAPS, "conductance": (4e-9, 1e-8)}),
    "pressure_sensors_lag": RigFault(_lag(encoder=False), {"time_constant": (0.003, 0.06)}),
    "encoder_lags": RigFault(_lag(encoder=True), {"time_constant": (0.002, 0.04)}),
    "supply_too_high": RigFault(_supply, {"share": (1.35, 1.7)}),
    "exhausts_restricted": RigFault(_exhausts, {"share": (0.1, 0.5)}),
    "board_restart": RigFault(_restart),
    "board_frozen": RigFault(_freeze, {"reset_after": (0.02, 0.3)}),
    "counter_jump": RigFault(_misbehave("counter_jump"), {"by": (1, 255)}),
    "counter_frozen": RigFault(_misbehave("counter_frozen")),
    "not_available_between": RigFault(_misbehave("not_available_between")),
    "pressure_stuck": RigFault(_pressure(_stuck)),
    "pressure_noisy": RigFault(_pressure(_noisy), {"amplitude": (2e4, 1e5)}),
    "pressure_noisier": RigFault(_pressure(_noisy), {"amplitude": (5.4e3, 6.2e3)}),
    "pressure_too_high": RigFault(_pressure(_constant), {"shown": (6.7e5, 1.2e6)}),
    "pressure_too_low": RigFault(_pressure(_constant), {"shown": (-1e5, -4e4)}),
    "pressure_lost": RigFault(_pressure(_lost)),
    "pressure_drift": RigFault(_pressure(_drifting), {"rate": (3e4, 1.5e5)}),
    "pressure_offset": RigFault(_pressure(_offset), {"by": (6e4, 3e5)}),
    "pressures_swapped": RigFault(_swap),
    "encoder_stuck": RigFault(_encoder(_stuck)),
    "encoder_noisy": RigFault(_encoder(_noisy), {"amplitude": (0.05, 0.3)}),
    "encoder_jump": RigFault(_encoder(_offset), {"by": (0.25, 1.0)}),
    "encoder_drift": RigFault(_encoder(_drifting), {"rate": (0.2, 1.0)}),
    "encoder_out_of_range": RigFault(_encoder(_constant_either_way), {"shown": (1.5, 8.0)}),
    "encoder_lost": RigFault(_encoder(_lost)),
    "valve_stuck_open": RigFault(_valve(1.0)),
    "valve_stuck_shut": RigFault(_valve(0.0)),
    "valve_stuck_exhausting": RigFault(_valve(-1.0)),
    "muscle_burst": RigFault(_leak, {"conductance": (4e-9, 1e-8)}),
    "muscle_leak": RigFault(_leak, {"conductance": (1.2e-9, 4e-9)}),
    "muscle_leak_small": RigFault(_leak, {"conductance": (1e-10, 1.2e-9)}),
    "supply_lost": RigFault(_supply, {"share": (0.0, 0.4)}),
    "supply_sags": RigFault(_supply, {"share": (0.6, 0.72)}),
    **{name: RigFault(inject) for name, inject in device_fault_injection.INJECTIONS.items()},
    "canopen_emergency": RigFault(
        device_fault_injection.INJECTIONS["canopen_emergency"], {"value": (0x1000, 0x8FFF)}),
}  # fmt: skip
"""How each fault is brought about, and the ranges of its numbers on the elbow of config/."""


def parse_injection(text: str, rig: Rig) -> tuple[str, dict[str, float]]:
    """Read `name value=0.3 duration=1`; a missing value is the middle of its range on this rig.

    Raises
    ------
    PamError
        For an unknown fault or value, or a value that is not a number.
    """
    name, *pairs = text.split()[:16] or [""]
    if name not in FAULTS:
        raise PamError(unknown("fault", name, FAULTS))
    ranges = ranges_on(name, FAULTS[name].ranges, rig)
    values = {key: 0.5 * (low + high) for key, (low, high) in ranges.items()}
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
    FAULTS[name].inject(stage, values, draw)


def mend(stage: FaultStage) -> None:
    """End every fault that can end."""
    stage.frames.faults.clear()
    stage.sim.faults.clear()
    for index in range(len(stage.sim.rig.muscles)):
        stage.sim.open_leak(index, 0.0)
    stage.sim.set_supply_pressure(stage.sim.rig.supply_pressure)
    for board in stage.sim.boards.values():
        board.misbehave("mended", 0.0)
