"""Configures, activates, deactivates and cleans up a driver process again and again.

`pam check lifecycle --cycles 1000 --unplugged 200` runs a simulated rig and a driver on a
loopback multicast bus and monitors the driver's threads, file handles, sockets and memory. In some
randomly drawn cycles the bus is lost while the driver is active, in one of four ways: python-can
raises ENETDOWN, python-can raises ENODEV, the boards send nothing, or the process of the boards is
stopped. In half of these cycles the bus returns before the driver is cleaned up, and the driver
must activate again; in the other half the driver is cleaned up without a bus.
"""

from __future__ import annotations

import errno
import os
import random
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from pam_check.endurance.process_use import Use, use_of
from pam_check.endurance.unpluggable_bus import INTERFACE, PLUG
from pam_demo.chain import Chain, multicast_bus, private_domain, set_environment
from pam_demo.processes import NodeProcess
from pam_demo.programs import MODULES
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import load_rig
from pam_ros.start import start_ros

PATIENCE = 30.0  # s
WARM = 10  # cycles until caches are filled; only the last two of them may lose the bus
MEMORY_ALLOWED = 1.05
WAYS = ("down", "gone", "silent", "stopped")
_ERRORS = {"down": errno.ENETDOWN, "gone": errno.ENODEV}
_T = Transition


class Cycles(NamedTuple):
    """Resources of the driver after WARM cycles and at the end, and counts of lost buses."""

    before: Use
    after: Use
    lost: Counter[str]

    @property
    def leaks(self) -> list[str]:
        """Names of the resources that have grown."""
        before, after = self.before, self.after
        names = [name for name in ("threads", "handles", "sockets")
                 if getattr(after, name) > getattr(before, name)]  # fmt: skip
        return names + ["memory"] * (after.memory > MEMORY_ALLOWED * before.memory)


class Plug:
    """Interrupts the bus in one of WAYS, and restores it."""

    def __init__(self, path: Path, rig: NodeProcess, node: LifecycleCycler) -> None:
        self._path, self._rig, self._node = path, rig, node

    def pull(self, way: str) -> None:
        """Interrupt the bus."""
        if way in _ERRORS:
            # atomic, so that the driver never reads an incomplete number
            part = self._path.with_suffix(".part")
            part.write_text(str(_ERRORS[way]), encoding="ascii")
            part.replace(self._path)
        elif way == "stopped":
            os.kill(self._rig.pid, signal.SIGSTOP)
        else:
            self._node.inject("all_frames_lost_up duration=1000")

    def replug(self, way: str) -> None:
        """Restore the bus."""
        self._path.unlink(missing_ok=True)
        os.kill(self._rig.pid, signal.SIGCONT)
        if way == "silent":
            self._node.mend()


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
        """Spin until a condition is true; raise PamError after a time-out."""
        clock = self.get_clock()
        end = clock.now().nanoseconds + int(PATIENCE * 1e9)
        while not condition():
            if clock.now().nanoseconds > end:
                raise PamError(f"time-out after {PATIENCE:g} s while waiting for: {what}")
            rclpy.spin_once(self, timeout_sec=0.01)

    def _call(self, client: Any, request: Any) -> Any:
        self.until(client.service_is_ready, client.srv_name)
        future = client.call_async(request)
        self.until(future.done, f"answer of {client.srv_name}")
        return future.result()

    def change(self, transition: int) -> bool:
        """Request a transition; return whether it succeeded."""
        request = ChangeState.Request()
        request.transition.id = transition
        return bool(self._call(self._change, request).success)

    def state(self) -> int:
        """The driver's state."""
        return int(self._call(self._get, GetState.Request()).current_state.id)

    def inject(self, fault: str) -> None:
        """Inject a fault into the rig."""
        # a message that is sent before the rig is discovered would be lost silently
        self.until(lambda: self._faults.get_subscription_count() > 0, "the rig's topic")
        self._faults.publish(String(data=fault))

    def mend(self) -> None:
        """Remove the rig's faults."""
        self._call(self._mend, Trigger.Request())

    def cycle(self, plug: Plug, way: str = "", back: bool = True) -> None:
        """Perform all four transitions.

        Parameters
        ----------
        plug : Plug
            Interrupts and restores the bus.
        way : str
            How the bus is lost in between, one of WAYS; empty: it is not lost.
        back : bool
            Whether the bus returns before the driver is cleaned up.
        """
        if not self.change(_T.TRANSITION_CONFIGURE):
            raise PamError("the driver cannot be configured")
        # boards that missed commands while the bus was lost have latched a fault
        self.until(self._activates, "activation")
        if way:
            plug.pull(way)
            self.until(lambda: self.state() == State.PRIMARY_STATE_INACTIVE, f"a fault: {way}")
            if self.change(_T.TRANSITION_ACTIVATE):
                raise PamError(f"the driver activates although the bus is lost: {way}")
            self._call(self._clear, Trigger.Request())
            if back:
                plug.replug(way)
                self.until(self._activates, f"activation after the bus returned: {way}")
        if back and not self.change(_T.TRANSITION_DEACTIVATE):
            raise PamError("the driver cannot be deactivated")
        if not self.change(_T.TRANSITION_CLEANUP):
            raise PamError("the driver cannot be cleaned up")
        if way and not back:
            plug.replug(way)

    def _activates(self) -> bool:
        """Activate; if that fails, clear latched faults, as an operator would before a new try."""
        return self.change(_T.TRANSITION_ACTIVATE) or not self._call(self._clear, Trigger.Request())


@contextmanager
def _chain(rig: Path, plug: Path) -> Iterator[tuple[LifecycleCycler, Chain, NodeProcess]]:
    environment = private_domain()
    with set_environment(environment):
        start_ros([])
    node = LifecycleCycler()
    bus = multicast_bus()
    try:
        with Chain([rig], bus, environment) as chain:
            chain.start("rig")
            driver = NodeProcess(
                MODULES["driver"],
                {
                    "bus.interface": INTERFACE,
                    "bus.channel": bus.channel,
                    "bus.options": f"port={bus.port}",
                    "autostart": False,
                },
                [rig],
                {**environment, PLUG: str(plug)},
            )
            chain.processes["driver"] = driver
            yield node, chain, driver
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def draw_losses(cycles: int, unplugged: int, seed: int) -> dict[int, tuple[str, bool]]:
    """Cycles in which the bus is lost: how, and whether it returns before the clean-up.

    Raises
    ------
    PamError
        If there are too few cycles after the first WARM ones.
    """
    free = range(WARM, cycles)
    if unplugged > len(free):
        raise PamError(
            f"unplugged = {unplugged}: expected at most {len(free)}, cycles minus {WARM}"
        )
    draw = random.Random(seed)
    chosen = draw.sample(free, unplugged)
    # each way occurs equally often; their order is drawn at random
    return {
        number: (WAYS[index % len(WAYS)], index // len(WAYS) % 2 == 0)
        for index, number in enumerate(chosen)
    } | ({WARM - 2: ("gone", True), WARM - 1: ("silent", False)} if unplugged else {})


def run_cycles(rig: Path, cycles: int, unplugged: int = 0, seed: int = 0) -> Cycles:
    """Run the cycles.

    Parameters
    ----------
    rig : Path
        Rig file.
    cycles, unplugged : int
        Number of cycles, and number of those after the first WARM in which the bus is lost.
    seed : int
        Seed for the cycles that lose the bus, and for the way.

    Raises
    ------
    PamError
        If a transition fails.
    """
    losses = draw_losses(cycles, unplugged, seed)
    lost: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plug"
        with _chain(rig, path) as (node, chain, driver):
            plug = Plug(path, chain.processes["rig"], node)
            try:
                for number in range(cycles):
                    way, back = losses.get(number, ("", True))
                    node.cycle(plug, way, back)
                    if way and number >= WARM:
                        lost[f"{way}, {'back' if back else 'cleaned up without'}"] += 1
                    if number == min(WARM, cycles) - 1:
                        before = use_of(driver.pid)
                    chain.check()
                return Cycles(before, use_of(driver.pid), lost)
            finally:
                plug.replug("")


def run(given: Arguments) -> Outcome:
    """Run the cycles and print the result; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        If a transition fails, or there are fewer cycles than the bus shall be lost in.
    """
    most = max(given.cycles - WARM, 0)
    unplugged = min(given.cycles // 5, most) if given.unplugged is None else given.unplugged
    if unplugged > most:
        raise PamError(
            f"--unplugged {unplugged}: expected at most {most}: the bus is not lost in the first "
            f"{WARM} of --cycles {given.cycles}"
        )
    rig = chosen_rig(given)
    load_rig(rig)  # a mistake in the rig file is reported here, before any process starts
    done = run_cycles(rig, given.cycles, unplugged, given.seed)
    before, after = done.before, done.after
    growth = 100.0 * (after.memory / before.memory - 1.0)
    print(
        f"{given.cycles} cycles: threads {before.threads} to {after.threads}, file handles "
        f"{before.handles} to {after.handles}, sockets among them {before.sockets} to "
        f"{after.sockets}, memory {before.memory / 2**20:.1f} to {after.memory / 2**20:.1f} MiB "
        f"({growth:+.1f} %)"
    )
    print("bus lost: " + "; ".join(f"{way} {count}" for way, count in sorted(done.lost.items())))
    for leak in done.leaks:
        print(f"GROWS: {leak}", file=sys.stderr)
    return Outcome(
        {"cycles": given.cycles, "before": before, "after": after, "bus_lost": done.lost},
        [f"{leak}: grows" for leak in done.leaks],
    )
