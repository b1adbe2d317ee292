"""Opens CAN buses with python-can, with messages that say what to do if that fails."""

from __future__ import annotations

import contextlib
import os
import socket
import sys
from pathlib import Path
from typing import Any, Final

import can

from pam_driver.can_bus.bitrate import DEFAULT_BITRATE
from pam_model.errors import PamError

_ARPHRD_CAN: Final = 280
_CAN_FD_MTU: Final = 72
_NET: Final = Path("/sys/class/net")
_MOST_WAITING: Final = 256  # frames that arrived before the socket was ready

# linux/in.h and linux/in6.h; Python's socket module has no names for them
_IP_MULTICAST_ALL: Final = 49
_IPV6_MULTICAST_ALL: Final = 29


class BusError(PamError):
    """A bus that cannot be opened; the message names it and says what to do."""


def bus_name(arguments: dict[str, Any]) -> str:
    """How messages name a bus that was opened with these arguments."""
    return f"{arguments['interface']} {arguments['channel']}"


def open_can_bus(arguments: dict[str, Any]) -> can.BusABC:
    """Open a bus of python-can.

    Parameters
    ----------
    arguments : dict
        As `can.Bus` takes them; "interface" and "channel" must be among them.

    Raises
    ------
    BusError
        If there is no such bus, or it is not up.
    """
    name = bus_name(arguments)
    if arguments["interface"] == "socketcan":
        _check_socketcan(str(arguments["channel"]), fd=bool(arguments.get("fd")))
    try:
        bus = can.Bus(**arguments)
    except Exception as error:  # each backend has exceptions of its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BusError(
            f"CAN bus {name} cannot be opened: {reason}; check bus.interface and bus.channel"
        ) from error
    if arguments["interface"] == "udp_multicast":
        hear_own_group_only(bus)
    return bus


def hear_own_group_only(bus: can.BusABC) -> None:
    """Keep the frames of other multicast groups on the same port away from this bus.

    python-can binds its socket to the port alone. Linux then delivers every group that any socket
    of the host has joined, so that two simulated robots would command each other's valves
    (ip(7), IP_MULTICAST_ALL). Frames that arrived before the option was set are discarded.

    Parameters
    ----------
    bus : can.BusABC
        A bus of the interface "udp_multicast" that was just opened.
    """
    if not sys.platform.startswith("linux"):
        return
    with socket.socket(fileno=os.dup(bus.fileno())) as same_socket:
        if same_socket.family == socket.AF_INET6:
            same_socket.setsockopt(socket.IPPROTO_IPV6, _IPV6_MULTICAST_ALL, 0)
        else:
            same_socket.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
        same_socket.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            for _ in range(_MOST_WAITING):
                same_socket.recv(1)


def _check_socketcan(channel: str, *, fd: bool) -> None:
    """Refuse a channel that cannot be opened, with a clearer message than the kernel's number."""
    folder = _NET / channel
    up = f"sudo ip link set {channel} up type can bitrate {DEFAULT_BITRATE}"
    if "/" in channel or not channel or not folder.exists():
        known = sorted(path.name for path in _NET.glob("*can*"))
        raise BusError(
            f"CAN bus socketcan {channel}: no such interface"
            f" (there {'are ' + ', '.join(known) if known else 'is none'});"
            f" plug the adapter in, or set bus.interface and bus.channel"
        )
    if int((folder / "type").read_text()) != _ARPHRD_CAN:
        raise BusError(f"CAN bus socketcan {channel}: is no CAN interface; set bus.channel")
    if not int((folder / "flags").read_text(), 16) & 1:
        raise BusError(f"CAN bus socketcan {channel}: interface is down; try: {up}")
    if fd and int((folder / "mtu").read_text()) < _CAN_FD_MTU:
        raise BusError(
            f"CAN bus socketcan {channel}: carries no CAN FD frames; set it down, and try: {up} "
            f"dbitrate 2000000 fd on"
        )
