"""Configures, activates, deactivates and cleans up a driver process again and again.

`python -m pam_sim.lifecycle_cycles_node --cycles 1000` runs a simulated rig and a driver on a
loopback multicast bus and watches the driver's threads, file handles and memory. In every fifth
cycle the boards fall silent while valves may move. Exit code 1 if anything grows.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from pam_model.errors import PamError
from pam_sim.demo.chain import Chain, multicast_bus, private_domain

PATIENCE = 30.0  # s
WARM = 10  # cycles until caches are filled
UNPLUG_EVERY = 5
MEMORY_ALLOWED = 1.05
_T = Transition


class Use(NamedTuple):
    """What a process holds: threads, file handles, resident memory [byte]."""

    threads: int
    handles: int
    memory: int


def use_of(pid: int) -> Use:
    """Read from /proc."""
    folder = Path("/proc") / str(pid)
    fields = dict(
        line.split(":", 1) for line in (folder / "status").read_text().splitlines() if ":" in line
    )
    memory = int(fields["VmRSS"].split()[0]) * 1024
    return Use(int(fields["Threads"]), len(list((folder / "fd").iterdir())), memory)


class LifecycleCycler(Node):  # type: ignore[misc]
    """Client of the driver's lifecycle and the rig's faults."""

    def __init__(self) -> None:
        super().__init__("lifecycle_cycler")
        self._change = self.create_client(ChangeState, "pam_driver/change_state")
        self._get = self.create_client(GetState, "pam_driver/get_state")
        self._mend = self.create_client(Trigger, "pam_rig/mend_faults")
        self._clear = self.create_client(Trigger, "pam_driver/clear_faults")
        self._faults = self.create_publisher(String, "pam_rig/inject_fault", 10)

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Spin until something holds; PamError if it does not."""
        clock = self.get_clock()
        end = clock.now().nanoseconds + int(PATIENCE * 1e9)
        while not condition():
            if clock.now().nanoseconds > end:
                raise PamError(f"waited in vain: {what}")
            rclpy.spin_once(self, timeout_sec=0.01)

    def _call(self, client: Any, request: Any) -> Any:
        self.until(client.service_is_ready, client.srv_name)
        future = client.call_async(request)
        self.until(future.done, f"answer of {client.srv_name}")
        return future.result()

    def change(self, transition: int) -> bool:
        """Ask for a transition; whether it came about."""
        request = ChangeState.Request()
        request.transition.id = transition
        return bool(self._call(self._change, request).success)

    def state(self) -> int:
        """The driver's state."""
        return int(self._call(self._get, GetState.Request()).current_state.id)

    def cycle(self, unplug: bool) -> None:
        """All four transitions; with `unplug` the boards fall silent in between."""
        if not self.change(_T.TRANSITION_CONFIGURE):
            raise PamError("the driver does not configure")
        self.until(lambda: self.change(_T.TRANSITION_ACTIVATE), "activation")
        if unplug:
            # a message sent before the rig is discovered would be lost without a word
            self.until(lambda: self._faults.get_subscription_count() > 0, "the rig's topic")
            self._faults.publish(String(data="all_frames_lost_up duration=1000"))
            self.until(lambda: self.state() == State.PRIMARY_STATE_INACTIVE, "a fault")
            self._call(self._clear, Trigger.Request())
            self._call(self._mend, Trigger.Request())
        else:
            self.change(_T.TRANSITION_DEACTIVATE)
        if not self.change(_T.TRANSITION_CLEANUP):
            raise PamError("the driver does not clean up")


def run_cycles(rig: Path, cycles: int) -> tuple[Use, Use]:
    """What the driver held after WARM cycles and at the end.

    Raises
    ------
    PamError
        If a transition fails.
    """
    environment = private_domain()
    os.environ.update(environment)
    rclpy.init(args=[])
    node = LifecycleCycler()
    try:
        with Chain([rig], multicast_bus(), environment) as chain:
            chain.start("rig")
            driver = chain.start("driver", {"autostart": False})
            for number in range(cycles):
                node.cycle(number % UNPLUG_EVERY == UNPLUG_EVERY - 1)
                if number == min(WARM, cycles) - 1:
                    before = use_of(driver.pid)
                chain.check()
            return before, use_of(driver.pid)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run it; 0 if nothing grows, 1 if something does, 2 if it cannot run."""
    parser = argparse.ArgumentParser(
        prog="python -m pam_sim.lifecycle_cycles_node", description=__doc__
    )
    parser.add_argument("--rig", type=Path, default=Path("config/elbow.yaml"))
    parser.add_argument("--cycles", type=int, default=1000)
    parsed = parser.parse_args(arguments)
    try:
        before, after = run_cycles(parsed.rig, max(parsed.cycles, 1))
    except PamError as error:
        print(error, file=sys.stderr)
        return 2
    growth = after.memory / before.memory
    print(
        f"{parsed.cycles} cycles: threads {before.threads} to {after.threads}, file handles "
        f"{before.handles} to {after.handles}, memory {100.0 * (growth - 1.0):+.1f} %"
    )
    leaks = after.threads > before.threads or after.handles > before.handles
    return 1 if leaks or growth > MEMORY_ALLOWED else 0


if __name__ == "__main__":
    sys.exit(main())
