"""Finds identifiers that cannot work on their bus: used twice, taken by CANopen, or of CAN FD.

Source of the CANopen ranges: CiA 301 version 4.2, predefined connection set, and CiA 305 (LSS).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from pam_driver.boards.protocol import Address, Board, WiredBoard
from pam_driver.can_bus.identifiers import EXTENDED, FD, number_of, shown
from pam_model.rig import Bus

NMT: Final = 0x000
_CANOPEN: Final = (
    (0x000, 0x000, "NMT"),
    (0x080, 0x080, "SYNC"),
    (0x081, 0x0FF, "EMCY"),
    (0x100, 0x100, "TIME"),
    (0x181, 0x1FF, "TPDO1"),
    (0x201, 0x27F, "RPDO1"),
    (0x281, 0x2FF, "TPDO2"),
    (0x301, 0x37F, "RPDO2"),
    (0x381, 0x3FF, "TPDO3"),
    (0x401, 0x47F, "RPDO3"),
    (0x481, 0x4FF, "TPDO4"),
    (0x501, 0x57F, "RPDO4"),
    (0x581, 0x5FF, "SDO answers"),
    (0x601, 0x67F, "SDO requests"),
    (0x701, 0x77F, "heartbeat"),
    (0x7E4, 0x7E5, "LSS"),
)


def canopen_use(frame_id: int) -> str:
    """What CANopen uses an identifier for; "" if it leaves it free."""
    if frame_id & EXTENDED:
        return ""
    number = number_of(frame_id)
    return next((use for low, high, use in _CANOPEN if low <= number <= high), "")


def identifier_clashes(
    boards: Mapping[Address, Board],
    wired: Mapping[Address, WiredBoard],
    buses: Mapping[str, Bus],
) -> Iterator[str]:
    """One line for each identifier that cannot be used.

    Parameters
    ----------
    boards : mapping of address to Board
        The boards of a rig.
    wired : mapping of address to WiredBoard
        Their sections, which name the bus.
    buses : mapping of str to Bus
        The buses that the rig file describes; empty if it describes none.
    """
    taken: dict[tuple[str, int], str] = {}
    devices = {
        wired[address].bus: board.name
        for address, board in boards.items()
        if _speaks_canopen(board)
    }
    for address, board in boards.items():
        name = wired[address].bus
        bus = buses.get(name)
        for frame_id in (*board.identifiers.answers, *board.identifiers.commands):
            other = taken.setdefault((name, number_of(frame_id) | frame_id & EXTENDED), board.name)
            if other != board.name:
                yield f"{board.name}: {other} uses identifier {shown(frame_id)} as well"
            elif canopen_use(frame_id) and not _speaks_canopen(board):
                because = ""
                if name in devices:
                    because = f"{devices[name]} on the same bus is a CANopen device"
                elif bus is not None and bus.canopen:
                    because = f"buses.{name}.canopen says that CANopen devices share this bus"
                if because:
                    yield (
                        f"{board.name}: identifier {shown(frame_id)} is {canopen_use(frame_id)} of "
                        f"CANopen, and {because}"
                    )
            if bus is not None and frame_id & FD and not bus.fd:
                yield (
                    f"{board.name}: message {shown(frame_id)} is a CAN FD frame, and "
                    f"buses.{name}.fd is false"
                )
    for address, board in boards.items():
        for frame_id in board.identifiers.service:
            other = taken.get((wired[address].bus, frame_id), board.name)
            if other != board.name:
                yield f"{board.name}: {other} uses identifier {shown(frame_id)} as well"


def _speaks_canopen(board: Board) -> bool:
    return NMT in board.identifiers.service
