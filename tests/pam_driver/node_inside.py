"""The driver node inside the process of a test, with a board at the other end of its bus."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from types import SimpleNamespace

import pytest
import rclpy
from lifecycle_msgs.msg import State

from pam_demo.chain import private_domain
from pam_driver import driver_node
from pam_driver.boards.pam_board.codec import (
    BoardCodec,
)
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_driver.driver_node import DriverNode

from .fake_board import FakeBoard
from .node_bench import ELBOW, PATIENCE

TIMEOUT = 30.0


PARAMETERS = {
    "bus.interface": "virtual",
    "startup_timeout": TIMEOUT,
    "plausibility": "false",
    "rate": 100.0,
    "sensor_timeout": 1.0,
    "board_timeout": 5.0,
}


class Inside:
    """A node, the far end of its bus, and a clock of the node that can be put forward."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, codec: BoardCodec, *extra: tuple[str, object]
    ) -> None:
        channel = f"bus_{uuid.uuid4().hex}"
        arguments = ["--ros-args", "--params-file", str(ELBOW), "-p", f"bus.channel:={channel}"]
        for name, value in [*PARAMETERS.items(), *extra]:
            arguments += ["-p", f"{name}:={value}"]
        rclpy.init(args=arguments, domain_id=int(private_domain()["ROS_DOMAIN_ID"]))
        self.ahead = 0.0
        clock = SimpleNamespace(
            monotonic=lambda: time.monotonic() + self.ahead,
            monotonic_ns=time.monotonic_ns,
            time=time.time,
            sleep=time.sleep,
        )
        monkeypatch.setattr(driver_node, "time", clock)
        self.codec = codec
        self.port: CanPort = open_bus("virtual", channel)
        self.board = FakeBoard(self.port, codec)
        self.node = DriverNode()

    def answer(self, until: Callable[[], bool]) -> None:
        """Let the board answer until something holds."""
        end = time.monotonic() + PATIENCE
        while not until():
            assert time.monotonic() < end
            self.board.step(time.monotonic())
            time.sleep(0.005)

    def healthy(self) -> bool:
        driver = self.node._driver
        return driver is not None and not driver.activation_problem(time.monotonic())

    def is_active(self) -> bool:
        return bool(self.node._state_machine.current_state[0] == State.PRIMARY_STATE_ACTIVE)

    def close(self) -> None:
        self.node.close()
        self.node.destroy_node()
        self.port.close()
        rclpy.try_shutdown()
