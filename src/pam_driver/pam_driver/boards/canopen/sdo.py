"""SDO requests that never wait: one expedited transfer at a time, advanced by the driver's cycles.

The blocking client of `canopen` would stop the driver's loop for the time of an answer, or need a
thread; the loop must continue while a device that has restarted is configured again. All objects
that a driver configures have at most four bytes, so expedited transfers are sufficient. The texts
of abort codes are those of `canopen`. Source: CiA 301 version 4.2, section 7.2.4.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import Final, NamedTuple

from canopen.sdo.exceptions import SdoAbortedError

from pam_driver.boards.canopen.device import Check, Step, Write
from pam_driver.boards.canopen.dictionary import ObjectName
from pam_driver.boards.frame_errors import FrameLengthError, FrameRangeError
from pam_driver.boards.protocol import NEVER

_REQUEST: Final = struct.Struct("<BHB4s")
_ABORT, _UPLOADED, _DOWNLOADED = 0x80, 0x40, 0x60
_EXPEDITED: Final = 0x02
_ATTEMPTS: Final = 3


def abort_text(code: int) -> str:
    """An abort code with its meaning, as text."""
    meaning = SdoAbortedError.CODES.get(code, "a code of the device's maker or profile")
    return f"abort code 0x{code:08X}, {meaning[:1].lower()}{meaning[1:]}"


class SdoResult(NamedTuple):
    """How a request ended: the value that was read, or what went wrong, as text."""

    value: int = 0
    error: str = ""
    aborted: bool = False


class SdoClient:
    """Requests to one device.

    Parameters
    ----------
    node : int
        Node number of the device.
    timeout : float
        How long an answer is waited for before the request is repeated [s].

    Attributes
    ----------
    surplus : int
        Answers without a request: a second device with the same node number gives one to each.
    """

    def __init__(self, node: int, timeout: float) -> None:
        self.request_id = 0x600 + node
        self.answer_id = 0x580 + node
        self._node = node
        self._timeout = timeout
        self._step: Step | None = None
        self._sent_at = NEVER
        self._attempts = 0
        self._result: SdoResult | None = None
        self.surplus = 0
        self._unanswered: Counter[ObjectName] = Counter()

    def begin(self, step: Step) -> None:
        """Begin a request; its frame is returned by `frame`."""
        self._step, self._result = step, None
        self._sent_at, self._attempts = NEVER, 0

    def cancel(self) -> None:
        """Forget the request."""
        self._step = self._result = None

    def frame(self, now: float) -> bytes | None:
        """The payload to send now [s]: the request, or its repetition; None while waiting."""
        step = self._step
        if step is None or self._result is not None or now - self._sent_at < self._timeout:
            return None
        if self._attempts == _ATTEMPTS:
            waited = f"{_ATTEMPTS} times {1e3 * self._timeout:g} ms"
            self._result = SdoResult(error=self._told(step, f"no answer within {waited}"))
            return None
        self._attempts += 1
        self._sent_at = now
        self._unanswered[step.name] += 1
        if isinstance(step, Check):
            return _REQUEST.pack(0x40, *step.name, bytes(4))
        specifier = 0x23 | (4 - len(step.data)) << 2
        return _REQUEST.pack(specifier, *step.name, step.data.ljust(4, b"\0"))

    def take(self) -> SdoResult | None:
        """The result of the request, once; None while it is not known."""
        result = self._result
        if result is not None:
            self.cancel()
        return result

    def hear(self, data: bytes) -> None:
        """Take an answer of the device.

        Raises
        ------
        FrameError
            If it is no answer of CANopen.
        """
        if len(data) != 8:
            raise FrameLengthError(
                self.answer_id, f"SDO answer of node {self._node} has {len(data)} bytes, expected 8"
            )
        specifier, index, sub, rest = _REQUEST.unpack(data)
        if (specifier & 0x1F and specifier & 0xE0 in {_ABORT, _DOWNLOADED}) or specifier >= 0xA0:
            raise FrameRangeError(
                self.answer_id, f"SDO answer of node {self._node} begins with 0x{specifier:02X}"
            )
        step, name = self._step, ObjectName(index, sub)
        if name in self._unanswered:
            self._unanswered[name] -= 1
            if self._unanswered[name] < 0:
                self._unanswered[name] = 0
                self.surplus += 1
        if step is None or name != step.name or self._result is not None:
            return  # an answer to another tool, or one that comes late
        kind = specifier & 0xE0
        if kind == _ABORT:
            text = abort_text(int.from_bytes(rest, "little"))
            self._result = SdoResult(error=self._told(step, text), aborted=True)
        elif kind == _UPLOADED and isinstance(step, Check):
            size = 4 - (specifier >> 2 & 3) if specifier & 1 else 4
            if specifier & _EXPEDITED:
                self._result = SdoResult(int.from_bytes(rest[:size], "little"))
            else:
                self._result = SdoResult(error=self._told(step, "is longer than 4 bytes"))
        elif kind == _DOWNLOADED and isinstance(step, Write):
            self._result = SdoResult()

    def _told(self, step: Step, what: str) -> str:
        verb = "reading" if isinstance(step, Check) else "writing"
        return f"node {self._node}, {verb} {step.name} ({step.why}): {what}"
