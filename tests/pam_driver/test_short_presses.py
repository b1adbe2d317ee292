"""A real driver, a real publisher: an emergency stop that is pressed for one message is latched.

A few presses; tests/pam_driver/test_short_noes.py has a thousand, with the same queue, in one
process.
"""

from __future__ import annotations

import random
import signal
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool

from pam_demo.chain import free_udp_port, private_domain
from pam_driver.boards.pam_board.codec import BoardCodec
from pam_ros.driver_state import LATCHED

from .node_bench import DriverProcess, RealTimeBoard, RosPeer

pytestmark = pytest.mark.system

PAUSE = 0.07  # s
# messages after the press, and whether the driver stands still meanwhile
PRESSES = ((1, False), (1, True), (300, False), (300, True))


def test_a_press_of_one_message_is_latched_each_time(codec: BoardCodec, tmp_path: Path) -> None:
    bus = {
        "interface": "udp_multicast",
        "channel": f"239.74.163.{random.randint(10, 250)}",
        "port": free_udp_port(),
    }
    board = RealTimeBoard(codec, bus)
    peer = RosPeer(int(private_domain()["ROS_DOMAIN_ID"]))
    told: list[Any] = []
    peer.node.create_subscription(DiagnosticStatus, "/pam_driver/state", told.append, LATCHED)
    topic = "/pam_driver/emergency_stop_released"
    released = peer.node.create_publisher(Bool, topic, QoSProfile(depth=10))
    peer.node.create_timer(0.05, lambda: released.publish(Bool(data=True)))
    settings = {"people.emergency_stop_topic": True, "people.deadline": 5.0}
    domain = peer.context.get_domain_id()
    driver = DriverProcess(tmp_path, domain, bus, parameters=settings)

    def is_in(state: str) -> bool:
        return bool(told) and told[-1].message.startswith(state)

    try:
        peer.position = [0.1, -0.1]
        for permissions, pauses in PRESSES:
            peer.until(lambda: is_in("active"), "moving air")
            if pauses:
                driver.send(signal.SIGSTOP)
            released.publish(Bool(data=False))
            for _ in range(permissions):
                released.publish(Bool(data=True))
            if pauses:
                time.sleep(PAUSE)
                driver.send(signal.SIGCONT)
            peer.until(lambda: is_in("fault"), "the latched fault")
            assert "the emergency stop is pressed" in told[-1].message
            assert peer.trigger("clear_faults").success
            peer.until(lambda: is_in("vented"), "empty muscles")
            peer.until(lambda: peer.lifecycle() == "inactive", "inactive")
            assert peer.change(Transition.TRANSITION_ACTIVATE), driver.errors
    finally:
        driver.end()
        board.stop()
        peer.close()
