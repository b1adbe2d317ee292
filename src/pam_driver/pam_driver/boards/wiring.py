"""The board and channel of each muscle and joint of a rig, checked by the kinds of board."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches

from pam_driver.boards.identifier_clashes import identifier_clashes
from pam_driver.boards.protocol import (
    Address,
    Board,
    BoardKind,
    Channel,
    HasDoubts,
    Identifiers,
    JointWire,
    KindOptions,
    MakeKind,
    MuscleWire,
    WiredBoard,
)
from pam_driver.boards.register import DEFAULT_KIND, board_kinds
from pam_driver.can_bus.identifiers import EXTENDED
from pam_model.errors import RigError
from pam_model.rig import Rig

Place = tuple[Address, Channel]


class RigWiring:
    """The rig's wiring, checked against what its kinds of board provide.

    Parameters
    ----------
    rig : Rig
        Every muscle needs board and channel, every joint an encoder.
    options : mapping of str to str, optional
        Options for the kinds of board in addition to the rig file, such as `dbc`.
    kinds : mapping of str to MakeKind, optional
        Kinds by name; by default all that are installed.

    Attributes
    ----------
    muscles, sensors, joints : tuple of (address, channel)
        Of the valve and the pressure sensor by muscle, and of the encoder by joint, in the rig's
        order.
    boards : dict of address to WiredBoard
        What is wired to each board, in the order in which the rig file names them.
    kinds : dict of str to BoardKind
        The kinds in use, by name.
    doubts : tuple of str
        What is odd about boards that can be used, as a flaw in a line of a device's file.

    Raises
    ------
    RigError
        If something is not wired, unknown, out of range or wired twice, with one line for each.
    """

    def __init__(
        self,
        rig: Rig,
        options: KindOptions | None = None,
        kinds: Mapping[str, MakeKind] | None = None,
    ) -> None:
        problems: list[str] = []
        muscles = _muscle_places(rig, problems)
        sensors = _sensor_places(rig, muscles, problems)
        joints = _joint_places(rig, problems)
        if not rig.muscles:
            problems.append("the rig has no muscle")
        self._buses = rig.buses
        self.boards = _wired_boards(rig, muscles, sensors, joints, problems)
        known = board_kinds() if kinds is None else kinds
        self.kinds: dict[str, BoardKind] = {}
        for board in self.boards.values():
            problem = _kind_problem(rig, board, known)
            if problem:
                problems.append(problem)
            else:
                name = kind_name(board)
                if name not in self.kinds:
                    self.kinds[name] = known[name](options or {})
        for name, kind in self.kinds.items():
            problems += kind.problems([b for b in self.boards.values() if kind_name(b) == name])
        if problems:
            raise RigError("\n".join(problems))
        self.doubts = tuple(
            line
            for kind in self.kinds.values()
            if isinstance(kind, HasDoubts)
            for line in kind.doubts
        )
        self.muscles = tuple(muscles.values())
        self.sensors = tuple(sensors.values())
        self.joints = tuple(joints.values())

    @property
    def buses(self) -> tuple[str, ...]:
        """The names of the buses that boards are on; "" for the only one."""
        return tuple(dict.fromkeys(board.bus for board in self.boards.values()))

    def identifiers(self, bus: str) -> Identifiers:
        """The identifiers of all boards on a bus."""
        boards = self.make_boards()
        found = [boards[a].identifiers for a, wired in self.boards.items() if wired.bus == bus]
        return Identifiers(
            tuple(frame_id for one in found for frame_id in one.answers),
            tuple(frame_id for one in found for frame_id in one.commands),
            tuple(frame_id for one in found for frame_id in one.service),
        )

    def extended_identifiers(self, bus: str) -> tuple[int, ...]:
        """The identifiers of 29 bits on a bus; it passes on no others."""
        answers, commands, _ = self.identifiers(bus)
        return tuple(frame_id for frame_id in (*answers, *commands) if frame_id & EXTENDED)

    def make_boards(self) -> dict[Address, Board]:
        """New boards for one driver, by address.

        Raises
        ------
        RigError
            If an identifier cannot be used, see `identifier_clashes`.
        """
        made = {
            address: self.kinds[kind_name(wired)].make(wired)
            for address, wired in self.boards.items()
        }
        problems = list(identifier_clashes(made, self.boards, self._buses))
        if problems:
            raise RigError("\n".join(problems))
        return made


def kind_name(board: WiredBoard) -> str:
    """The name of a board's kind, from its section in the rig file; else the default kind."""
    return str(board.settings.get("kind", DEFAULT_KIND))


def _muscle_places(rig: Rig, problems: list[str]) -> dict[int, Place]:
    places: dict[int, Place] = {}
    taken: dict[Place, str] = {}
    for index, muscle in enumerate(rig.muscles):
        board, channel = muscle.board, muscle.channel
        if board is None or channel is None:
            problems.append(f"{muscle.name}: board and channel are missing")
            continue
        other = taken.setdefault((board, channel), muscle.name)
        if other != muscle.name:
            problems.append(f"{muscle.name}: {other} already uses board {board} channel {channel}")
        places[index] = (board, channel)
    return places


def _sensor_places(rig: Rig, muscles: Mapping[int, Place], problems: list[str]) -> dict[int, Place]:
    """Where each pressure is measured: on the board of the valve unless the rig file says where."""
    places: dict[int, Place] = {}
    taken: dict[Place, str] = {}
    for index, place in muscles.items():
        muscle = rig.muscles[index]
        sensor = muscle.pressure_sensor
        places[index] = place if sensor is None else (sensor.board, sensor.channel)
        other = taken.setdefault(places[index], muscle.name)
        if other != muscle.name:
            board, channel = places[index]
            problems.append(
                f"{muscle.name}.pressure_sensor: {other} already uses board {board} channel "
                f"{channel}"
            )
    return places


def _joint_places(rig: Rig, problems: list[str]) -> dict[int, Place]:
    places: dict[int, Place] = {}
    taken: dict[Place, str] = {}
    for index, joint in enumerate(rig.joints):
        encoder = joint.encoder
        if encoder is None:
            problems.append(f"{joint.name}.encoder: board and channel are missing")
            continue
        place = (encoder.board, encoder.channel)
        if taken.setdefault(place, joint.name) != joint.name:
            problems.append(
                f"{joint.name}.encoder: another joint already uses this input of board "
                f"{encoder.board}"
            )
        places[index] = place
    return places


def _wired_boards(
    rig: Rig,
    muscles: Mapping[int, Place],
    sensors: Mapping[int, Place],
    joints: Mapping[int, Place],
    problems: list[str],
) -> dict[Address, WiredBoard]:
    valves: dict[Address, list[MuscleWire]] = {}
    pressures: dict[Address, list[MuscleWire]] = {}
    angles: dict[Address, list[JointWire]] = {}
    for index, (board, channel) in muscles.items():
        valves.setdefault(board, []).append(MuscleWire(channel, index, rig.muscles[index]))
    for index, (board, channel) in sensors.items():
        pressures.setdefault(board, []).append(MuscleWire(channel, index, rig.muscles[index]))
    for index, (board, channel) in joints.items():
        angles.setdefault(board, []).append(JointWire(channel, index, rig.joints[index]))
    boards = {}
    for address in dict.fromkeys((*valves, *pressures, *angles)):
        settings = dict(rig.boards.get(str(address), {}) if isinstance(address, str) else {})
        if rig.buses and "bus" not in settings:
            if len(rig.buses) > 1:
                key = f"boards.{address}.bus" if isinstance(address, str) else f"board {address}"
                problems.append(
                    f"{key}: the rig has the buses {', '.join(rig.buses)}, so a section under "
                    "boards must say which of them it is on"
                )
            settings["bus"] = next(iter(rig.buses))
        boards[address] = WiredBoard(
            address,
            settings,
            valves=tuple(valves.get(address, ())),
            pressures=tuple(pressures.get(address, ())),
            angles=tuple(angles.get(address, ())),
            ambient_pressure=rig.gas.ambient_pressure,
            brake_release_delay=rig.people.brake_release_delay,
        )
    return boards


def _kind_problem(rig: Rig, board: WiredBoard, known: Mapping[str, MakeKind]) -> str:
    if isinstance(board.address, str) and board.address not in rig.boards:
        names = ", ".join(rig.boards) or "none"
        return f"{board.name}: boards has no section of this name (there are {names})"
    name = kind_name(board)
    if name in known:
        return ""
    close = get_close_matches(name, known, 1)
    hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(known)}"
    return f"boards.{board.address}.kind = {name}: unknown kind of board; {hint}"
