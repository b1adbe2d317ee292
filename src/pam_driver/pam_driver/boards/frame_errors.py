"""The errors of frames: each kind is counted and named, and none of them ends the driver."""

from __future__ import annotations

from pam_driver.can_bus.identifiers import shown
from pam_model.errors import PamError


class DbcError(PamError):
    """A DBC file that cannot be read or is incomplete; the message names file and reason."""


class EncodeError(PamError):
    """A message that cannot be encoded: value not finite or out of range, or unknown board."""


class FrameError(PamError):
    """A frame that is not a valid message of a board; `kind` is the name under which it counts."""

    kind = "frame"

    def __init__(self, frame_id: int, text: str) -> None:
        super().__init__(f"frame {shown(frame_id)}: {text}")
        self.frame_id = frame_id


class UnknownFrameError(FrameError):
    """A frame whose identifier belongs neither to the rig nor to another board of these kinds."""

    kind = "unknown_id"


class UnknownBoardError(FrameError):
    """A frame from or to a board that the rig file does not name."""

    kind = "unknown_board"


class ForeignCommandError(FrameError):
    """A command to one of the rig's boards that this driver has not sent."""

    kind = "foreign_command"


class FrameLengthError(FrameError):
    """A frame whose payload does not have the length that the board's protocol requires."""

    kind = "wrong_length"


class FrameCrcError(FrameError):
    """A frame whose checksum does not match its identifier and payload."""

    kind = "bad_crc"


class FrameRangeError(FrameError):
    """A frame with a value outside the range that the board's protocol allows."""

    kind = "out_of_range"
