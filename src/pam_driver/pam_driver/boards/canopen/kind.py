"""The kind `canopen`: checks its part of the rig file against EDS files, and makes its boards."""

from __future__ import annotations

from collections.abc import Sequence

from pam_driver.boards.canopen.board import CanopenBoard
from pam_driver.boards.canopen.device import CanopenDevice
from pam_driver.boards.canopen.host import Host
from pam_driver.boards.canopen.reader import CanopenDeviceReader, read_device
from pam_driver.boards.frame_errors import FrameError
from pam_driver.boards.protocol import Address, Board, KindOptions, WiredBoard


class CanopenKind:
    """Devices after CiA 301 that the driver configures and guards.

    Parameters
    ----------
    options : mapping of str to str
        Not used: every device names its own EDS file or profile.

    Attributes
    ----------
    doubts : list of str
        What is wrong with EDS files where no device depends on it.
    """

    def __init__(self, options: KindOptions) -> None:
        self.doubts: list[str] = []
        self._hosts: dict[str, Host] = {}
        self._devices: dict[Address, CanopenDevice] = {}

    def problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        """What is wrong with the sections of the devices, alone and on their bus together."""
        lines = []
        on_bus: dict[tuple[str, int], WiredBoard] = {}
        for board in wired:
            reader = CanopenDeviceReader(board)
            lines += reader.problems
            self.doubts += reader.doubts
            device = reader.device
            if device is None:
                continue
            self._devices[board.address] = device
            other = on_bus.setdefault((board.bus, device.node), board)
            if other is not board:
                lines.append(
                    f"boards.{board.address}.node = {device.node}: boards.{other.address} on the "
                    "same bus has this node number as well"
                )
        lines += self._host_problems(wired)
        return lines

    def _host_problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        """The driver is one node on each bus, with a number that no device has."""
        lines = []
        hosts: dict[str, tuple[int, WiredBoard]] = {}
        nodes = {
            (board.bus, self._devices[board.address].node): board.address
            for board in wired
            if board.address in self._devices
        }
        for board in wired:
            device = self._devices.get(board.address)
            if device is None:
                continue
            number, first = hosts.setdefault(board.bus, (device.host_node, board))
            where = f"boards.{board.address}.host_node = {device.host_node}"
            if number != device.host_node:
                lines.append(
                    f"{where}: boards.{first.address} on the same bus has {number}; the driver is "
                    "one node"
                )
            elif first is board and (board.bus, number) in nodes:
                taken = nodes[board.bus, number]
                lines.append(f"{where}: is the node number of boards.{taken}")
        return lines

    def make(self, wired: WiredBoard) -> Board:
        """A new board for one driver."""
        device = self._devices.get(wired.address)
        if device is None:
            device, _ = read_device(wired)
        return CanopenBoard(wired, device, self._hosts.setdefault(wired.bus, Host()))

    def stranger(self, frame_id: int, data: bytes) -> FrameError | None:
        """None: other nodes on the bus are no error."""
        return None
