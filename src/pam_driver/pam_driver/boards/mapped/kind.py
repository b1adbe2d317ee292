"""The kind `mapped`: checks its part of the rig file against DBC files, and makes its boards."""

from __future__ import annotations

from collections.abc import Sequence

from pam_driver.boards.frame_errors import FrameError
from pam_driver.boards.mapped.board import MappedBoard
from pam_driver.boards.mapped.device import MappedDevice
from pam_driver.boards.mapped.reader import MappedDeviceReader
from pam_driver.boards.protocol import Board, KindOptions, WiredBoard
from pam_model.errors import RigError


class MappedKind:
    """Devices whose messages are described by a DBC file and mapped by the rig file.

    Parameters
    ----------
    options : mapping of str to str
        Not used: every device names its own DBC file.

    Attributes
    ----------
    doubts : list of str
        What is odd about devices that can be used, as a flaw elsewhere in a DBC file.
    """

    def __init__(self, options: KindOptions) -> None:
        self.doubts: list[str] = []

    def problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        """What is wrong with the sections of the devices."""
        readers = [MappedDeviceReader(board) for board in wired]
        self.doubts += [doubt for reader in readers for doubt in reader.doubts]
        return [line for reader in readers for line in reader.problems]

    def make(self, wired: WiredBoard) -> Board:
        """A new board for one driver."""
        return MappedBoard(wired, read_device(wired))

    def stranger(self, frame_id: int, data: bytes) -> FrameError | None:
        """None: a vendor's DBC file does not distinguish its other frames from foreign ones."""
        return None


def read_device(wired: WiredBoard) -> MappedDevice:
    """The tables of a device.

    Raises
    ------
    RigError
        If its section cannot be used, with one line for each problem.
    """
    reader = MappedDeviceReader(wired)
    if reader.device is None:
        raise RigError("\n".join(reader.problems))
    return reader.device
