"""Checks a rig file for the driver without a bus, and says what each muscle is wired to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from pam_driver.boards.protocol import Address, Board, DescribesItself, NamesInvalidValues
from pam_driver.boards.weaker_promises import weaker_promises
from pam_driver.boards.wiring import RigWiring, kind_name
from pam_driver.bus_load import HIGHEST_LOAD, bus_load
from pam_driver.driver_settings import DriverSettings
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import RigError
from pam_model.rig import Bus, Rig, load_rig
from pam_model.robot import Robot, compose
from pam_model.views.pull_over_travel import refuse_slack_muscles
from pam_model.views.torque_range import first_angle_not_held
from pam_ros.foreign_text import shown

GAUGE_ERROR: Final = 0.01
"""Of a written supply, relative: that of a gauge of class 1."""


class Wire(NamedTuple):
    """What carries one quantity of a muscle or joint."""

    name: str
    what: str
    board: str
    channel: str
    kind: str
    bus: str
    signal: str


@dataclass
class RigCheck:
    """What `check-rig` found."""

    wires: list[Wire] = field(default_factory=list)  # one for each set point, pressure and angle
    # by bus, the share of time during which it carries frames; None if a board does not say
    loads: dict[str, float | None] = field(default_factory=dict)
    # by board, what it does not do for safety
    missing_promises: dict[str, list[str]] = field(default_factory=dict)
    # by board with measurement, the raw values that count as no measurement, by name
    invalid_values: dict[str, dict[str, int]] = field(default_factory=dict)
    # why the robot would not work although the file can be used
    problems: list[str] = field(default_factory=list)
    # what a person should know before air is turned on
    cautions: list[str] = field(default_factory=list)


def check_rig(rig: Rig, only: Bus, rate: float, dbc: str = "") -> RigCheck:
    """Check a rig as the driver does before it opens a bus.

    Parameters
    ----------
    only : Bus
        The bus of a rig whose file describes none.
    rate : float
        Cycles of the driver in a second [Hz].
    dbc : str, optional
        DBC file of the boards of the kind `pam_board`.

    Raises
    ------
    PamError
        If the driver or the controller would refuse the rig, with one line for each problem.
    """
    robot = compose(rig)
    refuse_slack_muscles(robot)  # as the controller does
    wiring = RigWiring(rig, {"dbc": dbc})
    boards = wiring.make_boards()
    found = RigCheck(list(_wires(rig, wiring, boards)))
    for name in wiring.buses:
        on_it = [boards[a] for a, wired in wiring.boards.items() if wired.bus == name]
        bus = rig.buses.get(name, only)
        load = _load(on_it, bus, rate)
        found.loads[name] = load
        if load is not None and load > HIGHEST_LOAD:
            found.problems.append(
                f"bus {name or bus.channel}: {len(on_it)} boards at {rate:g} Hz take "
                f"{100.0 * load:.0f} % of {bus.bitrate / 1000:g} kbit/s, expected at most "
                f"{100.0 * HIGHEST_LOAD:.0f} %: use another bus for some of them, a higher "
                "bitrate, or fewer frames"
            )
    for address, board in boards.items():
        found.problems += _too_slow(address, board, rate, found.wires)
        found.missing_promises[board.name] = weaker_promises(board)
        if isinstance(board, NamesInvalidValues):
            for (what, channel), values in board.invalid_values().items():
                called = f"{board.name}, {what} {channel}".rstrip()
                found.invalid_values[called] = {name: raw for raw, name in values.items()}
    found.cautions = [*wiring.doubts, *_overfilled(rig), *_weak_supply(rig), *_too_heavy(robot)]
    return found


def _overfilled(rig: Rig) -> Iterator[str]:
    supply = rig.supply_gauge_pressure
    weaker = [m for m in rig.muscles if m.max_pressure * (1.0 + GAUGE_ERROR) < supply]
    if weaker:
        least = min(muscle.max_pressure for muscle in weaker)
        yield (
            f"the supply of {supply:.0f} Pa gauge is above the max_pressure of "
            f"{', '.join(muscle.name for muscle in weaker)} (from {least:.0f} Pa): a valve that "
            "sticks open fills its muscle up to the supply, and no software can prevent it; lower "
            "the supply, or fit a relief valve"
        )


def _weak_supply(rig: Rig) -> Iterator[str]:
    """Whether the supply gives less than other keys count on, and would not if it were gauge."""
    supply = rig.supply_gauge_pressure
    beyond = [
        (value, f"{muscle.name}.{key}")
        for muscle in rig.muscles
        for key, value in (
            ("max_pressure", muscle.max_pressure),
            ("valve.full_scale", muscle.valve.full_scale),
        )
        if value is not None and supply * (1.0 + GAUGE_ERROR) < value <= rig.supply_pressure
    ]
    if beyond:
        yield (
            f"the supply of {supply:.0f} Pa gauge is below {', '.join(key for _, key in beyond)} "
            f"(up to {max(beyond)[0]:.0f} Pa gauge), which is then never reached; supply_pressure "
            f"is absolute: if {rig.supply_pressure:.0f} Pa are what a gauge shows, write "
            f"{rig.supply_pressure + rig.gas.ambient_pressure:.0f}"
        )


def _too_heavy(robot: Robot) -> Iterator[str]:
    for joint in robot.joints:
        found = first_angle_not_held(robot, joint)
        if found is not None:
            yield (
                f"{joint.name}: at {found.position:.2f} rad gravity pulls with "
                f"{found.gravity:.3g} N m, and its muscle holds at most {found.muscles:.3g} N m: "
                "the joint cannot stay at this angle"
            )


def _wires(rig: Rig, wiring: RigWiring, boards: dict[Address, Board]) -> Iterator[Wire]:
    entries = [
        entry
        for muscle, valve, sensor in zip(rig.muscles, wiring.muscles, wiring.sensors, strict=True)
        for entry in ((muscle.name, "setpoint", valve), (muscle.name, "pressure", sensor))
    ]
    entries += [
        (joint.name, "angle", place) for joint, place in zip(rig.joints, wiring.joints, strict=True)
    ]
    for name, what, (address, channel) in entries:
        board, wired = boards[address], wiring.boards[address]
        known = board.wires() if isinstance(board, DescribesItself) else {}
        signal = known.get((what, channel), "-")
        yield Wire(name, what, str(address), str(channel), kind_name(wired), wired.bus, signal)


def _too_slow(address: Address, board: Board, rate: float, wires: Sequence[Wire]) -> Iterator[str]:
    """Messages that come so rarely that the driver would take them for missing."""
    if not isinstance(board, DescribesItself):
        return
    settings = DriverSettings()
    measuring = {
        wire.signal.split(".")[0]
        for wire in wires
        if wire.board == str(address) and wire.what != "setpoint"
    }
    for one in board.traffic(rate):
        name, limit = (
            ("sensor_timeout", settings.sensor_timeout)
            if one.name in measuring
            else ("board_timeout", settings.board_timeout)
        )
        if one.frame_id in board.identifiers.answers and one.rate * limit < 1.0:
            yield (
                f"{board.name}: {one.name} comes every {1e3 / one.rate:g} ms, but {name} of the "
                f"driver is {1e3 * limit:g} ms by default, and the driver would vent"
            )


def _load(boards: list[Board], bus: Bus, rate: float) -> float | None:
    total = 0.0
    for board in boards:
        if not isinstance(board, DescribesItself):
            return None
        total += bus_load(board.traffic(rate), bus)
    return total


def run(given: Arguments) -> Outcome:
    """The command `check-rig`.

    Raises
    ------
    RigError
        If the driver would refuse the rig; every line begins with the file.
    """
    rig = load_rig(given.rig_file)
    only = Bus(bitrate=given.bitrate)
    try:
        found = check_rig(rig, only, given.rate, str(given.dbc or ""))
    except RigError as error:
        lines = str(error).splitlines()
        raise RigError("\n".join(f"{given.rig_file}: {line}" for line in lines)) from None
    _show(found, rig, only)
    document = {
        "rig": given.rig_file,
        "wires": found.wires,
        "bus_load": found.loads,
        "missing_promises": found.missing_promises,
        "invalid_values": found.invalid_values,
        "problems": found.problems,
        "cautions": found.cautions,
    }
    return Outcome(document, found.problems)


def _show(found: RigCheck, rig: Rig, only: Bus) -> None:
    header = Wire("name", "what", "board", "channel", "kind", "bus", "signal")
    rows = [header, *(wire._replace(bus=wire.bus or "-") for wire in found.wires)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(header))]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join(cells).rstrip())
    for name, load in found.loads.items():
        bus = rig.buses.get(name, only)
        share = "not known" if load is None else f"{100.0 * load:.0f} %"
        print(f"\nbus {name or '(the only one)'}: load {share} of {bus.bitrate / 1000:g} kbit/s")
    for called, values in found.invalid_values.items():
        listed = ", ".join(f"{raw} ({shown(name)})" for name, raw in values.items())
        print(f"{called}: no measurement at raw {listed}")
    for board, lines in found.missing_promises.items():
        for line in lines:
            print(f"{board}: {line}")
    for caution in found.cautions:
        print(f"CAUTION: {caution}")
    for problem in found.problems:
        print(f"PROBLEM: {problem}")
    if not found.problems:
        print("\nThe driver can use this rig.")
