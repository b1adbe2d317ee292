"""Makes a driver from a rig and the node's parameters, with its open buses."""

from __future__ import annotations

from typing import NamedTuple

from pam_driver.boards.wiring import RigWiring
from pam_driver.buses import OnlyBus, open_buses
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_diagnostics import DriverDiagnostics
from pam_driver.driver_parameters import bus_options, settings_of
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_ros.parameters import NodeParameters


class DriverParts(NamedTuple):
    """A driver, its buses by name, its diagnostics, and what is odd about its boards."""

    driver: Driver
    ports: dict[str, CanPort]
    diagnostics: DriverDiagnostics
    doubts: tuple[str, ...]


def assemble_driver(rig: Rig, values: NodeParameters[Rig]) -> DriverParts:
    """Open the buses of a rig and make its driver; every valve vents.

    Raises
    ------
    PamError
        If a bus cannot be opened, or the rig file does not describe the wiring; then no bus stays
        open.
    """
    wiring = RigWiring(rig, {"dbc": str(values["bus.dbc"])})
    ports = _open(rig, wiring, values)
    try:
        plausibility = None
        if values["plausibility"]:
            plausibility = PressurePlausibility(compose(rig), 1.0 / values.number("rate"))
        driver = Driver(rig, ports, settings_of(values), plausibility, wiring)
    except PamError:
        for port in ports.values():
            port.close()
        raise
    usual = values.number("bus.bitrate")
    bitrates = {
        name: float(rig.buses[name].bitrate) if name in rig.buses else usual for name in ports
    }
    diagnostics = DriverDiagnostics(driver, ports, bitrates)
    return DriverParts(driver, ports, diagnostics, wiring.doubts)


def _open(rig: Rig, wiring: RigWiring, values: NodeParameters[Rig]) -> dict[str, CanPort]:
    interface = str(values["bus.interface"])
    options = bus_options(str(values["bus.options"]))
    if interface == "udp_multicast":
        options["port"] = values["bus.port"]
    bitrate = int(values.number("bus.bitrate"))
    only = OnlyBus(interface, str(values["bus.channel"]), bitrate, options)
    return open_buses(rig, wiring, only, filtered=bool(values["bus.filter"]))
