"""Writes and reads sensor_msgs/JointState as the bytes that are sent, without message objects.

Making a message object, converting it and copying it field by field is most of what a Python node
does in a cycle at 500 Hz. Between two messages of one publisher only the stamp and the numbers
change. For every form of a message (its names and the lengths of its arrays) one `struct.Struct`
is made, which then writes or reads the whole message in one call.

Source of the layout: OMG, Common Data Representation (CDR) as in DDS-XTypes 1.3, section 7.4.1,
little-endian, with the alignment counted from the end of the encapsulation's four bytes. A
message in another layout (big-endian) is read by `pam_ros.message_decoder`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final, NamedTuple

from pam_ros.errors import MalformedMessageError

_KIND: Final = b"\x00\x01"  # encapsulation: CDR, little-endian
_BODY_AT: Final = 4  # after the kind and two bytes of options
_COUNT: Final = struct.Struct("<I")
_STAMP: Final = struct.Struct("<iI")
_TEXTS_AT: Final = _BODY_AT + _STAMP.size
_FORMS_KEPT: Final = 256  # a publisher that never repeats its names must not fill the memory


def stamp_of(data: bytes) -> float:
    """Stamp [s] of a message that begins with a std_msgs/Header; 0 if it has none to be read."""
    if len(data) < _TEXTS_AT or data[: len(_KIND)] != _KIND:
        return 0.0
    seconds, nanoseconds = _STAMP.unpack_from(data, _BODY_AT)
    return float(seconds) + 1e-9 * float(nanoseconds)


class JointStateFields(NamedTuple):
    """The fields of a sensor_msgs/JointState."""

    # seconds, nanoseconds: the stamp
    seconds: int
    nanoseconds: int
    frame_id: str  # of the header
    name: tuple[str, ...]  # names
    # position, velocity, effort: the numbers; each may be empty
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]

    @property
    def stamp(self) -> float:
        """The stamp [s]; 0 if the publisher set none."""
        return self.seconds + 1e-9 * self.nanoseconds


class _Form:
    """The layout of all messages with the same texts and the same lengths of the arrays."""

    def __init__(
        self, frame_id: str, names: tuple[str, ...], texts: bytes, lengths: tuple[int, int, int]
    ) -> None:
        self.frame_id = frame_id
        self.names = names
        self.texts = texts
        self.lengths = lengths
        layout = f"<2s2xiI{len(texts)}s"
        end = _TEXTS_AT + len(texts)
        for length in lengths:
            pad = -(end + 4) % 4
            layout += f"{pad}xI"
            end += pad + 4
            if length:
                pad = -(end - _BODY_AT) % 8
                layout += f"{pad}x{length}d"
                end += pad + 8 * length
        self.layout = struct.Struct(layout)
        # the places of count and numbers in what `layout` reads
        first = 4
        places = []
        for length in lengths:
            places.append(slice(first + 1, first + 1 + length))
            first += 1 + length
        self._position, self._velocity, self._effort = places

    def write(
        self,
        nanoseconds: int,
        position: Sequence[float],
        velocity: Sequence[float],
        effort: Sequence[float],
    ) -> bytes:
        """The bytes of a message."""
        counts = self.lengths
        seconds, rest = divmod(nanoseconds, 1_000_000_000)
        return self.layout.pack(
            _KIND, seconds, rest, self.texts,
            counts[0], *position, counts[1], *velocity, counts[2], *effort,
        )  # fmt: skip

    def read(self, data: bytes) -> JointStateFields | None:
        """The fields of a message; None if it has another form."""
        if len(data) < self.layout.size:
            return None
        found = self.layout.unpack_from(data)
        position, velocity, effort = self._position, self._velocity, self._effort
        if (
            found[3] != self.texts
            or found[0] != _KIND
            or (found[position.start - 1], found[velocity.start - 1], found[effort.start - 1])
            != self.lengths
        ):
            return None
        return JointStateFields(
            found[1],
            found[2],
            self.frame_id,
            self.names,
            found[position],
            found[velocity],
            found[effort],
        )


class JointStateWriter:
    """Writes the messages of one publisher.

    Parameters
    ----------
    frame_id : str, optional
        Of every message.
    """

    def __init__(self, frame_id: str = "") -> None:
        self._frame_id = frame_id
        self._forms: dict[tuple[tuple[str, ...], int, int, int], _Form] = {}

    def write(
        self,
        nanoseconds: int,
        names: tuple[str, ...],
        position: Sequence[float] = (),
        velocity: Sequence[float] = (),
        effort: Sequence[float] = (),
    ) -> bytes:
        """The bytes of one message.

        Parameters
        ----------
        nanoseconds : int
            The stamp, since 1970 [ns].
        position, velocity, effort : sequence of float, optional
            The numbers.
        """
        key = (names, len(position), len(velocity), len(effort))
        form = self._forms.get(key)
        if form is None:
            if len(self._forms) >= _FORMS_KEPT:
                self._forms.clear()
            texts = _written_texts(self._frame_id, names)
            form = self._forms[key] = _Form(self._frame_id, names, texts, key[1:])
        return form.write(nanoseconds, position, velocity, effort)


class JointStateReader:
    """Reads the messages of one topic; those in the form of the last one are read fastest."""

    def __init__(self) -> None:
        self._form: _Form | None = None

    def read(self, data: bytes) -> JointStateFields:
        """The fields of a message.

        Raises
        ------
        MalformedMessageError
            If the bytes are no JointState.
        """
        if self._form is not None:
            fields = self._form.read(data)
            if fields is not None:
                return fields
        if not is_little_endian(data):
            return _read_by_rclpy(data)
        self._form = _form_of(data)
        fields = self._form.read(data)
        if fields is None:
            raise MalformedMessageError("it ends too early")
        return fields


def is_little_endian(data: bytes) -> bool:
    """Whether the bytes of a message are in the layout that needs no rclpy."""
    return data[: len(_KIND)] == _KIND


def _written_texts(frame_id: str, names: tuple[str, ...]) -> bytes:
    """The bytes from the frame to the end of the names."""
    data = bytearray()

    def write(count: int) -> None:
        data.extend(bytes(-len(data) % 4) + _COUNT.pack(count))

    encoded = [frame_id.encode(), *(name.encode() for name in names)]
    for place, text in enumerate(encoded):
        write(len(text) + 1)
        data.extend(text + b"\x00")
        if place == 0:
            write(len(names))
    return bytes(data)


def _form_of(data: bytes) -> _Form:
    """The form of a message in this layout.

    Raises
    ------
    MalformedMessageError
        If the bytes are no JointState.
    """
    at = _TEXTS_AT

    def count() -> int:
        nonlocal at
        at += -at % 4
        (found,) = _COUNT.unpack_from(data, at)
        at += 4
        return int(found)

    def text() -> str:
        nonlocal at
        length = count()
        found = data[at : at + length - 1]
        if length < 1 or len(found) != length - 1:
            raise MalformedMessageError("a text of a wrong length")
        at += length
        return found.decode()

    try:
        frame_id = text()
        names = tuple(text() for _ in range(count()))
        texts = data[_TEXTS_AT:at]
        lengths = []
        for _ in range(3):
            lengths.append(count())
            if lengths[-1]:
                at += -(at - _BODY_AT) % 8 + 8 * lengths[-1]
            if at > len(data):
                raise MalformedMessageError("it ends too early")
    except (struct.error, UnicodeDecodeError) as error:
        raise MalformedMessageError(f"no sensor_msgs/JointState ({type(error).__name__})") from None
    first, second, third = lengths
    return _Form(frame_id, names, texts, (first, second, third))


def _read_by_rclpy(data: bytes) -> JointStateFields:
    """The fields of a message in another layout."""
    from sensor_msgs.msg import JointState  # noqa: PLC0415  (seldom needed)

    from pam_ros.message_decoder import decode  # noqa: PLC0415

    message = decode(data, JointState)
    return JointStateFields(
        message.header.stamp.sec,
        message.header.stamp.nanosec,
        message.header.frame_id,
        tuple(message.name),
        tuple(message.position),
        tuple(message.velocity),
        tuple(message.effort),
    )
