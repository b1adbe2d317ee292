"""What can be wrong with a frame: each kind is counted and named, none is fatal."""

from __future__ import annotations

from pam_driver.identifiers import shown
from pam_model.errors import PamError


class DbcError(PamError):
    """A DBC file that cannot be read or lacks something; the message names the file and the gap."""


class EncodeError(PamError):
    """A value that has no place in a frame: not finite, out of range, or an unknown board."""


class FrameError(PamError):
    """A frame that is no message of a board; `kind` is the name it is counted under."""

    kind = "frame"

    def __init__(self, frame_id: int, text: str) -> None:
        super().__init__(f"frame {shown(frame_id)}: {text}")
        self.frame_id = frame_id


class UnknownFrameError(FrameError):
    """No board of the rig, and no other board of their kinds, has this identifier."""

    kind = "unknown_id"


class UnknownBoardError(FrameError):
    """A frame of, or to, a board that the rig file does not name."""

    kind = "unknown_board"


class ForeignCommandError(FrameError):
    """A command to one of the rig's boards that this driver has not sent."""

    kind = "foreign_command"


class FrameLengthError(FrameError):
    """The payload is not as long as the board's protocol says."""

    kind = "wrong_length"


class FrameCrcError(FrameError):
    """The checksum does not fit identifier and payload."""

    kind = "bad_crc"


class FrameRangeError(FrameError):
    """A value is outside the range that the board's protocol allows."""

    kind = "out_of_range"
