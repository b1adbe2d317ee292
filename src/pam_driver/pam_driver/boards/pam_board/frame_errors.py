"""What can be wrong with a frame: each kind is counted and named, none is fatal."""

from __future__ import annotations

from pam_model.errors import PamError


class DbcError(PamError):
    """A DBC file that cannot be read or lacks something; the message names the file and the gap."""


class EncodeError(PamError):
    """A value that has no place in a frame: not finite, out of range, or an unknown board."""


class FrameError(PamError):
    """A frame that is no message of a board; `kind` is the name it is counted under."""

    kind = "frame"

    def __init__(self, frame_id: int, text: str) -> None:
        super().__init__(f"frame 0x{frame_id:03X}: {text}")
        self.frame_id = frame_id


class UnknownFrameError(FrameError):
    """No message of the DBC, for any board, has this identifier."""

    kind = "unknown_id"


class FrameLengthError(FrameError):
    """The payload is not as long as the DBC says."""

    kind = "wrong_length"


class FrameCrcError(FrameError):
    """The checksum does not fit identifier and payload."""

    kind = "bad_crc"


class FrameRangeError(FrameError):
    """A signal's raw value is outside the DBC's range."""

    kind = "out_of_range"
