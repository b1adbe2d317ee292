"""Shows the measurements of a robot's boards without a driver; nothing is ever sent.

A CAN controller still acknowledges what it receives. Where that must not happen either, the
interface has to be set up for it: `ip link set can0 type can listen-only on`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Final

from pam_driver.board_set import BoardSet, Port
from pam_driver.boards.wiring import RigWiring
from pam_driver.buses import bus_of_options, open_buses
from pam_driver.driver_settings import DriverSettings
from pam_driver.joint_velocity import JointVelocity
from pam_model.command_line import Arguments, Outcome
from pam_model.rig import Rig, load_rig

_POLL: Final = 0.005  # s
# Other devices may share the bus, and a driver may be running.
_NORMAL: Final = frozenset({"unknown_id", "foreign_command"})


class Monitor:
    """Decodes what the boards of a rig send.

    Parameters
    ----------
    ports : mapping of str to Port
        Open buses by name; only `receive_all` is called.
    """

    def __init__(self, rig: Rig, wiring: RigWiring, ports: Mapping[str, Port]) -> None:
        self._settings = DriverSettings()
        velocities = [
            JointVelocity(self._settings.velocity_bandwidth, self._settings.sensor_timeout)
            for _ in rig.joints
        ]
        self._boards = BoardSet(wiring, ports, velocities)
        self._rig = rig

    def receive(self, now: float, wall_now: float) -> None:
        """Take what has arrived into account."""
        self._boards.receive(now, wall_now)

    def pressures(self, now: float) -> dict[str, float | None]:
        """By muscle the pressure [Pa gauge]; None if it is too old."""
        samples = (samples[channel] for samples, channel in self._boards.pressures)
        return {
            muscle.name: sample.value if self._fresh(sample.time, now) else None
            for muscle, sample in zip(self._rig.muscles, samples, strict=True)
        }

    def angles(self, now: float) -> dict[str, float | None]:
        """By joint the angle [rad]; None if it is too old."""
        samples = (samples[channel] for samples, channel in self._boards.angles)
        return {
            joint.name: sample.value if self._fresh(sample.time, now) else None
            for joint, sample in zip(self._rig.joints, samples, strict=True)
        }

    def conditions(self, now: float) -> list[str]:
        """What is wrong with the boards, and frames that were not valid messages."""
        settings = self._settings
        found = [
            str(condition)
            for board in self._boards.boards.values()
            for condition in board.conditions(
                now, settings.board_timeout, settings.sensor_timeout, False
            )
        ]
        errors = self._boards.last_frame_error
        return found + [text for kind, text in errors.items() if kind not in _NORMAL]

    def _fresh(self, measured_at: float, now: float) -> bool:
        return now - measured_at <= self._settings.sensor_timeout


def run(given: Arguments) -> Outcome:
    """The command `monitor`.

    Raises
    ------
    PamError
        If the rig or a bus cannot be used.
    """
    rig = load_rig(given.rig_file)
    wiring = RigWiring(rig, {"dbc": str(given.dbc or "")})
    only = bus_of_options(rig, given.interface, given.channel, given.port)
    ports = open_buses(rig, wiring, only)
    monitor = Monitor(rig, wiring, ports)
    now = time.monotonic()
    end, due = now + given.duration, now + given.period
    try:
        while now < end:
            time.sleep(_POLL)
            now = time.monotonic()
            monitor.receive(now, time.time())
            if now >= due:
                due += given.period
                print(_line(monitor, now))
    finally:
        for port in ports.values():
            port.close()
    wrong = monitor.conditions(now)
    for text in wrong:
        print(text)
    document = {
        "pressures": monitor.pressures(now),
        "angles": monitor.angles(now),
        "conditions": wrong,
    }
    return Outcome(document, wrong)


def _line(monitor: Monitor, now: float) -> str:
    parts = [
        f"{name} {'-' if value is None else f'{value / 1e3:.1f} kPa'}"
        for name, value in monitor.pressures(now).items()
    ]
    parts += [
        f"{name} {'-' if value is None else f'{value:.4f} rad'}"
        for name, value in monitor.angles(now).items()
    ]
    return "  ".join(parts)
