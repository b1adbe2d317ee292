"""Lists what sends on a bus: boards of this project, CANopen nodes, and unknown frames.

Nothing is sent, unless CANopen nodes are to be asked for their identity. Sources:
docs/can_protocol.md; CiA 301 version 4.2, heartbeat protocol.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pam_driver.boards.frame_errors import FrameError
from pam_driver.boards.identifier_clashes import canopen_use
from pam_driver.boards.pam_board.codec import BoardCodec, Heartbeat
from pam_driver.can_bus.bus import ReceivedFrame, open_bus
from pam_driver.can_bus.identifiers import FD, shown
from pam_driver.tools.canopen_scan import Identity, ask_nodes
from pam_model.command_line import Arguments, Outcome

_POLL: Final = 0.005  # s
_CANOPEN_HEARTBEAT: Final = range(0x701, 0x780)
_CANOPEN_STATES: Final = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}


@dataclass
class FrameRecord:
    """The frames of one identifier."""

    frame_id: int  # with the flags of `identifiers`
    count: int  # frames that were received
    # first, last: stamps of the first and last one [s]
    first: float
    last: float
    data: bytes  # the last payload
    # bytes that have differed between two frames; a changed length counts as the last byte
    changing: set[int]

    def add(self, frame: ReceivedFrame) -> None:
        """Take a further frame into account."""
        pairs = zip(self.data, frame.data, strict=False)
        self.changing |= {place for place, (old, new) in enumerate(pairs) if old != new}
        if len(self.data) != len(frame.data):
            self.changing.add(max(len(self.data), len(frame.data)) - 1)
        self.count += 1
        self.last, self.data = frame.stamp, frame.data

    @property
    def rate(self) -> float:
        """Frames in a second [Hz]; 0 for a single frame."""
        span = self.last - self.first
        return (self.count - 1) / span if span > 0.0 else 0.0


@dataclass(frozen=True)
class Heard:
    """One line of the list: who sends, and the identifier with its rate [Hz]."""

    identifier: str
    sender: str
    rate: float
    length: int
    data: str
    changing_bytes: tuple[int, ...]


def record(frames: Iterable[ReceivedFrame], records: dict[int, FrameRecord]) -> None:
    """Add frames to the records, by identifier."""
    for frame in frames:
        known = records.get(frame.frame_id)
        if known is None:
            records[frame.frame_id] = FrameRecord(
                frame.frame_id, 1, frame.stamp, frame.stamp, frame.data, set()
            )
        else:
            known.add(frame)


def name_senders(
    records: Iterable[FrameRecord],
    codec: BoardCodec,
    nodes: Mapping[int, Identity] | None = None,
) -> list[Heard]:
    """Who sends each identifier, in the order of the identifiers.

    Parameters
    ----------
    records : iterable of FrameRecord
        What was received.
    codec : BoardCodec
        Knows the frames of this project's boards. They are named only if the board's heartbeat was
        received too, since CANopen and other devices use the same identifiers.
    nodes : mapping of int to Identity, optional
        The CANopen nodes that have sent their identity, by node number.
    """
    known = sorted(records, key=lambda one: one.frame_id)
    boards: dict[int, Heartbeat] = {}
    for one in known:
        try:
            number, message = codec.decode(one.frame_id, one.data)
        except FrameError:
            continue
        if isinstance(message, Heartbeat):
            boards[number] = message
    return [
        Heard(
            shown(one.frame_id) + (" FD" if one.frame_id & FD else ""),
            _sender(one, codec, boards, nodes or {}),
            one.rate,
            len(one.data),
            one.data.hex(" "),
            tuple(sorted(one.changing)),
        )
        for one in known
    ]


def _sender(
    one: FrameRecord,
    codec: BoardCodec,
    boards: dict[int, Heartbeat],
    nodes: Mapping[int, Identity],
) -> str:
    try:
        number, message = codec.decode(one.frame_id, one.data)
    except FrameError:
        number, message = -1, None
    if message is not None and number in boards:
        version = boards[number]
        text = f"board {number} (pam_board), {type(message).__name__}"
        if isinstance(message, Heartbeat):
            text += f": protocol {version.protocol_version}, firmware {version.firmware_version}"
        return text
    if one.frame_id in _CANOPEN_HEARTBEAT and len(one.data) == 1:
        state = _CANOPEN_STATES.get(one.data[0] & 0x7F)
        if state is not None:
            node = one.frame_id - 0x700
            who = f": {nodes[node].text}" if node in nodes else ""
            return f"CANopen node {node}, {state}{who}"
    node, use = one.frame_id & 0x7F, canopen_use(one.frame_id)
    if node in nodes and use.startswith(("TPDO", "EMCY", "SDO answers")):
        return f"CANopen node {node}, {use}"
    return "unknown"


def run(given: Arguments) -> Outcome:
    """The command `scan`.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    """
    options = {} if given.port is None else {"port": given.port}
    interface, channel = given.interface or "socketcan", given.channel or "can0"
    port = open_bus(interface, channel, extended=None, fd=given.fd, **options)
    records: dict[int, FrameRecord] = {}
    end = time.monotonic() + given.duration
    nodes: dict[int, Identity] = {}
    try:
        if given.identify:
            nodes = ask_nodes(port)
        while (now := time.monotonic()) < end:
            record(port.receive_all(now), records)
            time.sleep(_POLL)
    finally:
        port.close()
    heard = name_senders(records.values(), BoardCodec.from_dbc(), nodes)
    _show(heard)
    for one in nodes.values():
        print(f"CANopen node {one.node}: {one.text}")
    nothing = f"no frame was received on {port.name} in {given.duration:g} s"
    if not heard and not nodes:
        print(f"{nothing}: check power, wiring and bitrate")
    document = {"bus": port.name, "frames": heard, "canopen_nodes": list(nodes.values())}
    return Outcome(document, [] if heard or nodes else [nothing])


def _show(heard: Sequence[Heard]) -> None:
    for one in heard:
        changing = ", ".join(map(str, one.changing_bytes)) or "none"
        print(
            f"{one.identifier:>13}  {one.rate:7.1f} Hz  {one.length:2d} bytes  {one.sender}\n"
            f"{'':>13}  last {one.data or '-'}; changing bytes: {changing}"
        )
