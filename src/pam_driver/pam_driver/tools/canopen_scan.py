"""Asks every CANopen node of a bus for its device type and identity, by SDO.

Many nodes send nothing before they are configured, so that only a question finds them. Source: CiA
301 version 4.2, objects 0x1000 and 0x1018.
"""

from __future__ import annotations

import time
from typing import Final, NamedTuple

from pam_driver.boards.canopen.device import Check
from pam_driver.boards.canopen.dictionary import ObjectName
from pam_driver.boards.canopen.sdo import SdoClient
from pam_driver.boards.frame_errors import FrameError
from pam_driver.can_bus.bus import CanPort

_PAUSE: Final = 0.002  # s
_TIMEOUT: Final = 0.1  # s
_QUESTIONS: Final = (
    Check(ObjectName(0x1000), 0, "device type"),
    *(
        Check(ObjectName(0x1018, sub), 0, name)
        for sub, name in enumerate(("vendor", "product", "revision", "serial"), 1)
    ),
)
_PROFILES: Final = {
    401: "I/O module",
    402: "drive",
    404: "measuring device or controller",
    406: "encoder",
    408: "hydraulic or pneumatic valve",
    410: "inclinometer",
}


class Identity(NamedTuple):
    """What a node says about itself; None where it does not answer."""

    node: int
    device_type: int | None
    vendor: int | None
    product: int | None
    revision: int | None
    serial: int | None

    @property
    def text(self) -> str:
        """The identity as text, with the names that the rig file uses."""
        words = []
        if self.device_type is not None:
            profile = self.device_type & 0xFFFF
            meaning = f", {_PROFILES[profile]}" if profile in _PROFILES else ""
            words.append(f"CiA {profile}{meaning}" if profile else "no device profile")
        for name in ("vendor", "product", "revision", "serial"):
            value = getattr(self, name)
            if value is not None:
                words.append(f"{name} 0x{value:X}")
        return ", ".join(words)


def ask_nodes(port: CanPort) -> dict[int, Identity]:
    """The identities of all nodes that answer, by node number; takes some tenths of a second."""
    clients = {node: SdoClient(node, _TIMEOUT) for node in range(1, 128)}
    by_answer = {client.answer_id: node for node, client in clients.items()}
    found: dict[int, list[int | None]] = {}
    waiting = dict.fromkeys(clients, 0)
    for client in clients.values():
        client.begin(_QUESTIONS[0])
    while waiting:
        now = time.monotonic()
        for frame in port.receive_all(now):
            node = by_answer.get(frame.frame_id)
            if node is not None:
                try:
                    clients[node].hear(frame.data)
                except FrameError:  # a device that does not speak CANopen
                    waiting.pop(node, None)
        for node in list(waiting):
            client, place = clients[node], waiting[node]
            data = client.frame(now)
            if data is not None:
                port.send(client.request_id, data, now)
                time.sleep(_PAUSE / 8)  # the transmit queue is short
            result = client.take()
            if result is None:
                continue
            if result.error and not result.aborted:  # no node has this number
                del waiting[node]
                continue
            found.setdefault(node, []).append(None if result.error else result.value)
            if place + 1 == len(_QUESTIONS):
                del waiting[node]
            else:
                waiting[node] = place + 1
                client.begin(_QUESTIONS[place + 1])
        time.sleep(_PAUSE)
    return {
        node: Identity(node, *(values + [None] * len(_QUESTIONS))[: len(_QUESTIONS)])
        for node, values in sorted(found.items())
    }
