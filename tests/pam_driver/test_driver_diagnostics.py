"""What the driver tells /diagnostics about suspicions and commanders."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus

from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.boards.protocol import Condition
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_diagnostics import DriverDiagnostics
from pam_driver.driver_settings import DriverSettings
from pam_model.rig import Rig
from pam_ros.periodic import LoopStatistics


def status_of(diagnostics: DriverDiagnostics, name: str) -> DiagnosticStatus:
    found = diagnostics.statuses(LoopStatistics(0, 0, 0, 0.0), 1.0)
    return next(status for status in found if status.name == f"pam_driver: {name}")


def test_a_suspicion_is_a_warning_by_name(
    rig: Rig, codec: BoardCodec, ports: tuple[CanPort, CanPort]
) -> None:
    driver = Driver(rig, ports[0], DriverSettings())
    diagnostics = DriverDiagnostics(driver, ports[0], 1e6)
    assert status_of(diagnostics, "safety").level == DiagnosticStatus.OK
    driver._judge.suspicions = (Condition("sensor_noise", "elbow_flexor", "noise 7000 Pa"),)
    status = status_of(diagnostics, "safety")
    assert status.level == DiagnosticStatus.WARN
    assert "elbow_flexor: noise 7000 Pa" in status.message


def test_a_second_commander_is_a_warning(
    rig: Rig, codec: BoardCodec, ports: tuple[CanPort, CanPort]
) -> None:
    diagnostics = DriverDiagnostics(Driver(rig, ports[0], DriverSettings()), ports[0], 1e6)
    diagnostics.commanders = 1
    assert status_of(diagnostics, "valve_commands").level == DiagnosticStatus.OK
    diagnostics.commanders = 2
    status = status_of(diagnostics, "valve_commands")
    assert status.level == DiagnosticStatus.WARN
    assert "2 nodes" in status.message
