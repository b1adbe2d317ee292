"""Runs a simulated rig on a CAN bus, without ROS.

`pam sim rig --rig config/elbow.yaml --interface udp_multicast --channel 239.74.163.2`
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from pam_driver.buses import bus_of_options, open_buses
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_sim.boards.protocol import BoardSettings
from pam_sim.boards.sensors import SensorQuality
from pam_sim.rig_loop import RigLoop
from pam_sim.simulated_rig import SimulatedRig

REPORT_PERIOD = 5.0


def parse_effects(texts: Sequence[str], source: str) -> dict[str, float]:
    """Read `name=value` pairs.

    Parameters
    ----------
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


def simulated_rig(
    rig: Rig,
    number: Callable[[str], float],
    effects: Mapping[str, float],
    *,
    true_rig: str | Path,
    dbc: str | Path,
    firmware: str | Path,
) -> SimulatedRig:
    """The simulated rig with the numbers of `rig_help.PARAMETERS`.

    Parameters
    ----------
    rig : Rig
        The rig file.
    number : callable
        The value of a parameter by its name.
    effects : mapping
        Hidden effects of the plant, as `parse_effects` returns them.
    true_rig, dbc, firmware : str or Path
        Files; empty for those that the parameters name as usual.
    """
    return SimulatedRig(
        rig,
        truth=load_rig(true_rig) if true_rig else None,
        effects=effects,
        options={"dbc": str(dbc), "firmware": str(firmware)},
        board=BoardSettings(
            measurement_rate=number("measurement_rate"), watchdog_period=number("watchdog") or None
        ),
        quality=SensorQuality(
            **{name: number(name) for name in SensorQuality.__dataclass_fields__}
        ),
        rate=number("rate"),
        step=number("step"),
        seed=int(number("seed")),
        now=time.monotonic(),
    )


def _make_loop(given: Arguments) -> RigLoop:
    rig = load_rig(given.rig)
    simulated = simulated_rig(
        rig,
        partial(getattr, given),
        dict(given.effect),
        true_rig=given.true_rig or "",
        dbc=given.dbc or "",
        firmware=given.firmware.resolve() if given.firmware else "",
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
