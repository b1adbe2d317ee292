"""Commands go on while the process that commissions computes; the port says what ends them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState

from pam_demo.chain import set_environment
from pam_demo.commission.ros_port_node import RosPort, open_ros_port
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_ros.driver_state import LATCHED, driver_state_message
from support.probe import Probe

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
PERIOD = 0.004
COMMAND_TIMEOUT = 0.1
"""Of the driver, by default [s]."""


@pytest.fixture
def elbow() -> Rig:
    return load_rig(ELBOW)


@pytest.fixture
def measured(probe: Probe, elbow: Rig) -> Iterator[Probe]:
    """A probe that publishes measurements, as a driver does."""
    going_on = threading.Event()
    joints = probe.node.create_publisher(JointState, "joint_states", 1)
    pressures = probe.node.create_publisher(JointState, "pressure_states", 1)

    def publish() -> None:
        while not going_on.wait(0.01):
            joints.publish(JointState(name=list(elbow.joint_names), position=[0.1]))
            pressures.publish(JointState(name=list(elbow.muscle_names), effort=[2e4, 3e4]))

    states = probe.node.create_publisher(DiagnosticStatus, "pam_driver/state", LATCHED)
    states.publish(driver_state_message("pam_driver", "fault", "the driver stood still"))
    thread = threading.Thread(target=publish, daemon=True)
    thread.start()
    yield probe
    going_on.set()
    thread.join(2.0)


@pytest.mark.system
def test_commands_go_on_while_this_process_computes(
    measured: Probe, elbow: Rig, ros_environment: dict[str, str]
) -> None:
    commands = measured.listen(JointState, "valve_commands")
    with set_environment(ros_environment), open_ros_port(elbow, "elbow", PERIOD) as port:
        assert port.advance([0.0, 0.0]).pressures == (2e4, 3e4)
        measured.wait_for("commands", lambda: len(commands) > 5, 10.0)
        first = len(commands)
        pow(3, 3_000_000)  # holds the interpreter for seconds
        measured.wait_for("commands", lambda: len(commands) > first + 20, 10.0)
        reading = port.advance([0.1, 0.0])
        assert np.isfinite(reading.time)
        assert reading.refusal == "the driver is fault (the driver stood still)"
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in commands]
    assert max(np.diff(stamps)) < COMMAND_TIMEOUT
    assert list(commands[-1].position) == [-1.0, -1.0]  # vented at the end


def test_a_node_that_ends_is_told() -> None:
    class Gone:
        def poll(self, _: float) -> bool:
            return True

        def recv(self) -> object:
            raise EOFError

        def send(self, _: object) -> None:
            raise BrokenPipeError

    with pytest.raises(PamError, match="has ended"):
        RosPort(Gone(), PERIOD)  # type: ignore[arg-type]
