"""Runs a simulated rig on a CAN bus, without ROS.

`pam sim rig --rig config/elbow.yaml --interface udp_multicast --channel 239.74.163.2`
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace

from pam_driver.buses import bus_of_options, open_buses
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.rig import load_rig
from pam_sim.boards.protocol import BoardSettings
from pam_sim.boards.sensors import SensorQuality
from pam_sim.rig_loop import RigLoop
from pam_sim.simulated_rig import SimulatedRig

REPORT_PERIOD = 5.0


def parse_effects(texts: Sequence[str], source: str) -> dict[str, float]:
    """Read `name=value` pairs.

    Parameters
    ----------
    texts : sequence of str
        The pairs.
    source : str
        The option or parameter that contains them, for the message.

    Raises
    ------
    PamError
        For a text that is not such a pair.
    """
    effects = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            effects[name.strip()] = float(value)
        except ValueError:
            raise PamError(f"{source} {text}: expected EFFECT.PARAMETER=NUMBER") from None
    return effects


def _make_loop(given: Arguments) -> RigLoop:
    rig = load_rig(given.rig)
    board = BoardSettings(watchdog_period=given.watchdog)
    if given.measurement_rate is not None:
        board = replace(board, measurement_rate=given.measurement_rate)
    named = {name: getattr(given, name) for name in SensorQuality.__dataclass_fields__}
    simulated = SimulatedRig(
        rig,
        truth=load_rig(given.true_rig) if given.true_rig else None,
        effects=dict(given.effect),
        options={
            "dbc": given.dbc or "",
            "firmware": str(given.firmware.resolve()) if given.firmware else "",
        },
        board=board,
        quality=SensorQuality(**{n: value for n, value in named.items() if value is not None}),
        rate=given.rate,
        step=DEFAULT_STEP if given.step is None else given.step,
        seed=given.seed,
        now=time.monotonic(),
    )
    only = bus_of_options(rig, given.interface, given.channel, given.port)
    ports = open_buses(rig, simulated.wiring, only)
    loop = RigLoop(simulated, ports, given.rate, realtime_priority=given.realtime_priority)
    loop.schedule(given.faults)
    return loop


def _serve(loop: RigLoop, duration: float | None) -> None:
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    end = None if duration is None else time.monotonic() + duration
    reported = 0.0
    next_report = time.monotonic() + REPORT_PERIOD
    loop.start()
    try:
        while not stopping.wait(0.1):
            loop.check()
            now = time.monotonic()
            if end is not None and now >= end:
                break
            if now >= next_report:
                next_report = now + REPORT_PERIOD
                report = loop.report()
                if report["skipped turns"] > reported:
                    print(
                        f"the host is too slow: {report['skipped turns'] - reported:.0f} turns in "
                        f"{REPORT_PERIOD:g} s were skipped and simulated together with later ones",
                        file=sys.stderr,
                    )
                    reported = report["skipped turns"]
    finally:
        loop.stop()


def run(given: Arguments) -> Outcome:
    """Simulate until a signal or the end of the duration; the command of `pam_sim.__main__`.

    Raises
    ------
    PamError
        If a rig, an effect, a fault or a bus cannot be used.
    """
    loop = _make_loop(given)
    _serve(loop, given.duration)
    return Outcome(loop.report())
