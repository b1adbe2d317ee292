"""Runs the nodes of a simulated rig as processes on a private bus, in the right order."""

from __future__ import annotations

import itertools
import os
import random
import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from pam_demo.processes import NodeProcess, Setting
from pam_demo.programs import MODULES, NODES_OF_ROBOT, ROBOT, ROBOT_COMMAND
from pam_model.program_signals import postponed
from pam_model.rig import load_rig

ON_THE_BUS = ("rig", "driver")
WITH_A_DRIVER = ("driver", "robot")
MULTICAST_GROUP = "239.74.163.2"
DOMAINS = 100
HELD_DOMAINS = 10
_domains = itertools.count(random.randrange(DOMAINS))
_held: dict[int, socket.socket] = {}


@dataclass(frozen=True, slots=True)
class BusChoice:
    """A CAN bus by python-can's names."""

    # interface, channel: as python-can takes them
    interface: str
    channel: str
    port: int = 0  # UDP port of a multicast bus, 0 for others

    @property
    def parameters(self) -> dict[str, Setting]:
        """Bus parameters for the nodes."""
        settings: dict[str, Setting] = {
            "bus.interface": self.interface,
            "bus.channel": self.channel,
        }
        if self.interface == "udp_multicast":
            settings["bus.port"] = self.port
        return settings

    def parameters_for(self, buses: Sequence[str]) -> dict[str, Setting]:
        """Bus parameters for the nodes of a rig whose file describes these buses.

        Each bus gets a channel of its own: this one, and those with the numbers after it.
        """
        if not buses:
            return self.parameters
        settings: dict[str, Setting] = {}
        stem = self.channel.rstrip("0123456789")
        first = int(self.channel[len(stem) :] or 0)
        for place, name in enumerate(buses):
            settings[f"buses.{name}.interface"] = self.interface
            settings[f"buses.{name}.channel"] = f"{stem}{first + place}"
            if self.interface == "udp_multicast":
                settings[f"buses.{name}.port"] = self.port
        return settings

    def __str__(self) -> str:
        if self.interface == "udp_multicast":
            return f"loopback multicast, port {self.port}"
        return f"{self.interface} {self.channel}"


def free_udp_port() -> int:
    """A UDP port that is not in use."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


def multicast_bus() -> BusChoice:
    """A multicast bus on a free port; its frames stay on this machine."""
    return BusChoice("udp_multicast", MULTICAST_GROUP, free_udp_port())


def best_bus(can: str = "") -> BusChoice:
    """The named CAN interface, else vcan0 if it is up, else a loopback multicast bus."""
    if can:
        return BusChoice("socketcan", can)
    flags = Path("/sys/class/net/vcan0/flags")
    if flags.exists() and int(flags.read_text(), 16) & 1:
        return BusChoice("socketcan", "vcan0")
    return multicast_bus()


def private_domain(numbers: Iterator[int] = _domains) -> dict[str, str]:
    """Environment of a ROS domain that is limited to this machine and not in use on it.

    Every call gives another domain, so that a chain does not meet nodes left over from another.
    Other processes of this machine that call this function get other ones, as long as this process
    runs and has not asked for `HELD_DOMAINS` more.

    Parameters
    ----------
    numbers : iterator of int, optional
        Of the domains that are tried, less 1.
    """
    for _ in range(DOMAINS):
        # 101 and above run into the ports the kernel hands out
        domain = 1 + next(numbers) % DOMAINS
        if not _has_participant(domain) and _reserve(domain):
            break
    return {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def _has_participant(domain: int) -> bool:
    """Whether a process has bound the port of one of a domain's first nodes (RTPS 9.6.1)."""
    for participant in range(3):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7400 + 250 * domain + 10 + 2 * participant))
            except OSError:
                return True
    return False


def _reserve(domain: int) -> bool:
    """Hold a name of the system that says so; False if another process holds it."""
    if not sys.platform.startswith("linux"):  # which frees such a name when the process ends
        return True
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(f"\0pam_ros_domain_{domain}")
    except OSError:
        held.close()
        return domain in _held
    _held[domain] = held
    while len(_held) > HELD_DOMAINS:
        _held.pop(next(iter(_held))).close()
    return True


@contextmanager
def set_environment(environment: Mapping[str, str]) -> Iterator[None]:
    """Set these environment variables of this process inside the context."""
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@dataclass(slots=True)
class Chain:
    """The processes of one simulated rig; they all end with the context."""

    params_files: Sequence[Path]  # the rig file first
    bus: BusChoice  # bus between rig and driver; the first one if the rig file describes several
    environment: Mapping[str, str]  # environment of the processes
    # processes that were started and not stopped
    processes: dict[str, NodeProcess] = field(default_factory=dict)
    # output of the processes that were stopped
    outputs: dict[str, str] = field(default_factory=dict)

    def start(self, name: str, parameters: Mapping[str, Setting] | None = None) -> NodeProcess:
        """Start one node of MODULES."""
        return self._start(name, MODULES[name], self._settings(name, parameters or {}))

    def start_robot(
        self, parameters: Mapping[str, Mapping[str, Setting]] | None = None
    ) -> NodeProcess:
        """Start driver, model and controller in one process, which is then called "robot".

        Parameters
        ----------
        parameters : mapping, optional
            For each of the nodes, by its name in MODULES, its parameters.
        """
        given = parameters or {}
        settings = {
            f"{node}:{key}": value
            for name, node in NODES_OF_ROBOT.items()
            for key, value in self._settings(name, given.get(name, {})).items()
        }
        return self._start("robot", ROBOT, settings, ROBOT_COMMAND)

    def _settings(self, name: str, parameters: Mapping[str, Setting]) -> dict[str, Setting]:
        settings: dict[str, Setting] = {}
        if name in ON_THE_BUS:
            settings.update(self.bus.parameters_for(tuple(load_rig(self.params_files[0]).buses)))
        return settings | dict(parameters)

    def _start(
        self, name: str, module: str, settings: Mapping[str, Setting], *words: str
    ) -> NodeProcess:
        with postponed():  # a process that is started must be known, so that it is ended
            process = NodeProcess(module, settings, self.params_files, self.environment, words)
            self.processes[name] = process
        return process

    def check(self) -> None:
        """Raise ProcessError if a process has ended by itself."""
        for process in self.processes.values():
            process.check()

    def stop(self, name: str) -> int:
        """End one process and return its exit code."""
        process = self.processes.pop(name)
        code = process.stop()
        self.outputs[name] = f"{self.outputs.get(name, '')}{process.output}\nexit code {code}\n"
        return code

    def stop_all(self) -> None:
        """End all processes: the driver first, which lowers the arm and vents, the rig last.

        Without its controller the driver would report a fault at every end.
        """
        names = list(self.processes)[::-1]
        try:
            for name in sorted(names, key=lambda name: name not in WITH_A_DRIVER):
                self.stop(name)
        except KeyboardInterrupt:  # asked again: nothing is waited for, and nothing is left behind
            for process in self.processes.values():
                process.kill()
            raise

    def write_logs(self, folder: Path) -> None:
        """Write what each process that has ended has printed."""
        for name, text in self.outputs.items():
            (folder / f"{name}.log").write_text(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop_all()
