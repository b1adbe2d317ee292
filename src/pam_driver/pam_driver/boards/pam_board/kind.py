"""The kind `pam_board`: checks its part of the rig file, and makes its boards."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pam_driver.boards.frame_errors import FrameError, UnknownBoardError, UnknownFrameError
from pam_driver.boards.pam_board.board import PamBoard
from pam_driver.boards.pam_board.codec import CHANNELS, BoardCodec
from pam_driver.boards.protocol import Board, KindOptions, WiredBoard

_KEYS = frozenset({"kind", "bus", "number", "identifiers"})
WITH_CANOPEN = "with_canopen"
_IDENTIFIERS = ("own_bus", WITH_CANOPEN)


class PamBoardKind:
    """The valve boards of this project, numbered on their bus.

    In the rig file, a board is either a number (`<muscle>.board: 0`), or a section
    `boards.<name>: {kind: pam_board, number: 0}` to which muscles and joints refer by name.

    Parameters
    ----------
    options : mapping of str to str
        `dbc`: path of a DBC file that replaces the one of this package.

    Raises
    ------
    DbcError
        If the DBC file cannot be used.
    """

    def __init__(self, options: KindOptions) -> None:
        path = options.get("dbc", "")
        self._path = Path(path) if path else None
        self.codec = BoardCodec.from_dbc(self._path)
        self._with_canopen: BoardCodec | None = None

    def codec_of(self, wired: WiredBoard) -> BoardCodec:
        """The codec with the identifiers of a board.

        Raises
        ------
        DbcError
            If the DBC file does not have the identifiers that share a bus with CANopen.
        """
        if wired.settings.get("identifiers") != WITH_CANOPEN:
            return self.codec
        if self._with_canopen is None:
            self._with_canopen = BoardCodec.from_dbc(self._path, with_canopen=True)
        return self._with_canopen

    def problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        """What is wrong with the numbers, channels and keys of the boards of this kind."""
        found: list[str] = []
        last = self.codec.board_count - 1
        numbers: dict[tuple[str, object, int], str] = {}
        for board in wired:
            number = _number(board)
            place = f"board {board.address}"
            for key in sorted(set(board.settings) - _KEYS):
                found.append(f"boards.{board.address}.{key}: unknown key of a pam_board")
            chosen = board.settings.get("identifiers", _IDENTIFIERS[0])
            if chosen not in _IDENTIFIERS:
                found.append(
                    f"boards.{board.address}.identifiers = {chosen}: expected "
                    f"{' or '.join(_IDENTIFIERS)}"
                )
            if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= last:
                if isinstance(board.address, str) and board.settings:  # else it has no section
                    found.append(
                        f"boards.{board.address}.number = {number!r}: expected 0 to {last}"
                    )
            else:
                other = numbers.setdefault((board.bus, chosen, number), board.name)
                if other != board.name:
                    found.append(f"{board.name}: {other} already uses number {number}")
            wrong_number = isinstance(board.address, int) and not 0 <= board.address <= last
            others = [wire for wire in board.pressures if wire not in board.valves]
            for wire in (*board.valves, *others):
                if wrong_number or wire.channel not in range(CHANNELS):
                    found.append(
                        f"{wire.muscle.name}: {place} channel {wire.channel}, expected board 0 "
                        f"to {last} and channel 0 to {CHANNELS - 1}"
                    )
            for angle in board.angles:
                if wrong_number or angle.channel != 0:
                    found.append(
                        f"{angle.joint.name}.encoder: {place} channel {angle.channel}, expected "
                        f"board 0 to {last} and channel 0"
                    )
        return found

    def make(self, wired: WiredBoard) -> Board:
        """A new board for one driver."""
        return PamBoard(number_of(wired), wired, self.codec_of(wired))

    def stranger(self, frame_id: int, data: bytes) -> FrameError | None:
        """The error for a wrong frame, or for a frame of a board that is not in the rig file."""
        for codec in (self.codec, self._with_canopen):
            if codec is None:
                continue
            try:
                number, _ = codec.decode(frame_id, data)
            except UnknownFrameError:
                continue
            except FrameError as error:
                return error
            return UnknownBoardError(frame_id, f"board {number}")
        return None


def number_of(wired: WiredBoard) -> int:
    """The number of a board that `problems` has checked."""
    number = _number(wired)
    if not isinstance(number, int):
        raise TypeError(f"{wired.name}: no number, although its problems were looked for")
    return number


def _number(wired: WiredBoard) -> object:
    return wired.address if isinstance(wired.address, int) else wired.settings.get("number")
