"""Kills a driving process many times and measures how soon the boards' watchdogs vent.

`pam check kill-trials --trials 200` forks a process that runs the suite's driver at
500 Hz in real time and commands simulated boards over a loopback multicast bus. The process is
ended by SIGKILL while air flows. Each board has to vent within its watchdog period plus 10 ms.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import statistics
import time

from pam_check.fault_kinds.fault_kind import WATCHDOG
from pam_demo.chain import BusChoice, multicast_bus
from pam_driver.can_bus.bus import open_bus
from pam_driver.driver import ActivationError, Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.refusals import COMMANDABLE
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_driver.snapshot import Snapshot
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_ros.valve_command import FLOW, ValveCommandFormat
from pam_sim.simulated_rig import SimulatedRig

ALLOWED = 0.010  # s, on top of the watchdog's period
PATIENCE = 20.0  # s
HOST_PERIOD, BOARD_PERIOD = 0.002, 0.001


def drive_for_ever(rig: Rig, bus: BusChoice, *, one_process: bool) -> None:
    """Activate as soon as the boards answer, and command air flow until the process is killed.

    With `one_process` the commands are made within the driver's cycle, else between two of them.
    """
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    driver = Driver(rig, port, DriverSettings())
    little = [0.1 if kind == FLOW else 1e4 for kind in rig.valve_kinds.values()]
    position, effort = ValveCommandFormat(rig.valve_kinds).pack(little)
    command = NamedCommand(rig.muscle_names, position, (), effort)

    def command_air(_: Snapshot | None = None) -> None:
        if driver.state in COMMANDABLE:  # not while it still measures whether all is empty
            driver.set_commands(command, time.monotonic())

    while True:
        now = time.monotonic()
        driver.cycle(now, time.time(), control=command_air if one_process else None)
        if driver.state is SafetyState.VENTED:
            with contextlib.suppress(ActivationError):  # not all boards have answered yet
                driver.activate(now)
        elif driver.state is SafetyState.FAULT:
            driver.clear_faults(now)
        elif not one_process:
            command_air()
        time.sleep(max(0.0, now + HOST_PERIOD - time.monotonic()))


def kill_once(rig: Rig, moving_for: float, *, one_process: bool) -> tuple[float, float]:
    """One trial: time from SIGKILL to vented boards, and their longest cycle time [s].

    Parameters
    ----------
    rig : Rig
        The rig.
    moving_for : float
        Time during which air flows before the kill [s].
    one_process : bool
        As for `drive_for_ever`.

    Raises
    ------
    PamError
        If the boards do not become active, or never vent.
    """
    bus = multicast_bus()
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    sim = SimulatedRig(rig, now=time.monotonic())
    child = os.fork()
    if child == 0:
        try:
            drive_for_ever(rig, bus, one_process=one_process)
        finally:
            os._exit(1)
    # a real board has its own processor, so other processes must not delay the simulated one
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    active_at = killed_at = None
    start = last = time.monotonic()
    longest = 0.0
    try:
        while True:
            now = time.monotonic()
            if killed_at is not None:
                longest = max(longest, now - last)
            last = now
            for frame in port.receive_all(now):
                sim.on_frame(frame.frame_id, frame.data, now)
            for sent in sim.advance(now):
                port.send(*sent, now)
            active = {board.active for board in sim.boards.values()}
            if active_at is None and active == {True}:
                active_at = now
            if killed_at is not None and True not in active:
                return time.monotonic() - killed_at, longest
            if active_at is not None and killed_at is None and now - active_at > moving_for:
                killed_at = time.monotonic()
                os.kill(child, signal.SIGKILL)
            if now - start > PATIENCE:
                state = "vented" if active_at is None else "active"
                raise PamError(f"the boards stay {state} for more than {PATIENCE:g} s")
            time.sleep(max(0.0, now + BOARD_PERIOD - time.monotonic()))
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        port.close()
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def run(given: Arguments) -> Outcome:
    """Kill, measure and print; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        If a trial could not be run.
    """
    bound = WATCHDOG + ALLOWED
    draw = random.Random(1)
    rig = load_rig(chosen_rig(given))
    done: list[tuple[float, float]] = []
    with progress(given.trials, "kill trials") as bar:
        for _ in range(given.trials):
            moving_for = draw.uniform(0.05, 0.25)
            done.append(kill_once(rig, moving_for, one_process=given.one_process))
            bar.show(len(done))
    times = [vented for vented, _ in done]
    late = sum(time > bound for time in times)
    own_delay = max(gap for _, gap in done)
    print(
        f"{len(times)} kills: vented after {1e3 * statistics.median(times):.1f} ms (median), "
        f"{1e3 * max(times):.1f} ms (worst), bound {1e3 * bound:.0f} ms; {late} late; the board's "
        f"own turn was {1e3 * own_delay:.1f} ms late at worst"
    )
    return Outcome(
        {
            "vented_after": times,
            "bound": bound,
            "late": late,
            "board_turn_late": own_delay,
            "unit": "s",
        },
        [f"{late} of {len(times)} vented later than {1e3 * bound:.0f} ms"] if late else (),
    )
