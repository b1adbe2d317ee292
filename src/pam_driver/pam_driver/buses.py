"""Opens the buses of a rig: those that its file describes, or the one that parameters name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from pam_driver.boards.wiring import RigWiring
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_driver.can_bus.bus_opening import BusError
from pam_driver.can_bus.identifiers import FD, shown
from pam_driver.driver_parameters import bus_options
from pam_model.errors import PamError
from pam_model.rig import Bus, Rig


class OnlyBus(NamedTuple):
    """The bus of a rig whose file describes none."""

    # interface, channel: as python-can takes them
    interface: str
    channel: str
    bitrate: int | None = None  # [bit/s]; None for the default
    options: Mapping[str, Any] = {}  # further options of the interface


def bus_of_options(
    rig: Rig, interface: str | None, channel: str | None, port: int | None
) -> OnlyBus:
    """The bus that the options of a command line name.

    Parameters
    ----------
    rig : Rig
        If its file describes buses, no option may be given.
    interface, channel : str or None
        As python-can takes them; by default SocketCAN's can0.
    port : int or None
        UDP port of a multicast bus.

    Raises
    ------
    PamError
        If an option contradicts the rig file.
    """
    options = {"interface": interface, "channel": channel, "port": port}
    for name, value in options.items():
        if rig.buses and value is not None:
            raise PamError(
                f"--{name}: the rig file describes its buses ({', '.join(rig.buses)}); change "
                f"buses.<name>.{name} there"
            )
    further = {} if port is None else {"port": port}
    return OnlyBus(interface or "socketcan", channel or "can0", None, further)


def open_buses(
    rig: Rig, wiring: RigWiring, only: OnlyBus, *, filtered: bool = False
) -> dict[str, CanPort]:
    """Open every bus on which a rig has boards.

    Parameters
    ----------
    rig : Rig
        The rig; its `buses` may be empty.
    only : OnlyBus
        The bus if the rig file describes none.
    filtered : bool, optional
        Let the kernel discard frames that no board of the rig sends (SocketCAN).

    Returns
    -------
    dict of str to CanPort
        By the name of the bus; "" for the only one.

    Raises
    ------
    PamError
        If a bus cannot be opened; the others are closed again.
    """
    opened: dict[str, CanPort] = {}
    try:
        for name in wiring.buses:
            bus = rig.buses.get(name)
            opened[name] = _open(wiring, name, only if bus is None else bus, filtered)
    except PamError:
        for port in opened.values():
            port.close()
        raise
    return opened


def _open(wiring: RigWiring, name: str, bus: OnlyBus | Bus, filtered: bool) -> CanPort:
    arguments: dict[str, Any] = {}
    identifiers = wiring.identifiers(name)
    if isinstance(bus, OnlyBus):
        fast = [i for i in (*identifiers.answers, *identifiers.commands) if i & FD]
        if fast:
            raise BusError(
                f"message {shown(fast[0])} is a CAN FD frame: describe the bus in the rig file, "
                "under buses, with fd: true"
            )
        arguments.update(bus.options)
        if bus.bitrate is not None:
            arguments["bitrate"] = bus.bitrate
    else:
        arguments.update(bus_options(bus.options), bitrate=bus.bitrate, fd=bus.fd)
        if bus.interface == "udp_multicast":
            arguments["port"] = bus.port
        elif bus.fd and bus.interface not in {"socketcan", "virtual"}:
            arguments["data_bitrate"] = bus.data_bitrate
    return open_bus(
        bus.interface,
        bus.channel,
        accept=identifiers.answers if filtered else (),
        extended=wiring.extended_identifiers(name),
        **arguments,
    )
