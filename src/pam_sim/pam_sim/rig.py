"""Runs a simulated rig on a CAN bus, without ROS.

`python -m pam_sim.rig --rig config/elbow.yaml --interface udp_multicast --channel 239.74.163.2`
"""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from collections.abc import Sequence

from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.bus import open_bus
from pam_model.errors import PamError
from pam_model.plant.simulate import DEFAULT_STEP
from pam_model.rig import load_rig
from pam_sim.boards.pam_board import BoardSettings
from pam_sim.boards.sensors import SensorQuality
from pam_sim.rig_loop import RigLoop
from pam_sim.simulated_rig import SimulatedRig

REPORT_PERIOD = 5.0


def _parser() -> argparse.ArgumentParser:
    quality, board = SensorQuality(), BoardSettings()
    parser = argparse.ArgumentParser(prog="python -m pam_sim.rig", description=__doc__)
    add = parser.add_argument
    add("--rig", required=True, help="rig file that driver and controller read")
    add("--true-rig", help="rig file of the plant as it really is; default --rig")
    add(
        "--effect",
        action="append",
        default=[],
        metavar="[NAME.]EFFECT.PARAMETER=VALUE",
        help="an effect on the plant, such as coulomb_friction.torque=0.5; may be repeated",
    )
    add("--interface", default="socketcan", help="python-can's interface (default %(default)s)")
    add("--channel", default="can0", help="python-can's channel (default %(default)s)")
    add("--port", type=int, help="of udp_multicast")
    add("--dbc", help="CAN database; default the driver's own")
    add("--rate", type=float, default=1000.0, help="turns per second [Hz] (default %(default)s)")
    add("--step", type=float, default=DEFAULT_STEP, help="RK4 step [s] (default %(default)s)")
    add("--measurement-rate", type=float, default=board.measurement_rate, help="[Hz]")
    add("--watchdog", type=float, help="of the boards [s]; default the DBC's")
    add("--pressure-noise", type=float, default=quality.pressure_noise, help="[Pa]")
    add("--position-noise", type=float, default=quality.position_noise, help="[rad]")
    add("--pressure-quantum", type=float, default=quality.pressure_quantum, help="[Pa]")
    add("--position-quantum", type=float, default=quality.position_quantum, help="[rad]")
    add("--faults", default="", help="to bring about: 'seconds name value=number; seconds name'")
    add("--seed", type=int, default=0, help="of the noise (default %(default)s)")
    add("--duration", type=float, help="end after so long [s]; default at a signal")
    return parser


def parse_effects(texts: Sequence[str]) -> dict[str, float]:
    """Read `name=value` pairs.

    Raises
    ------
    PamError
        For a text that is none.
    """
    effects = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            effects[name.strip()] = float(value)
        except ValueError:
            raise PamError(f"--effect {text}: expected EFFECT.PARAMETER=NUMBER") from None
    return effects


def _make_loop(arguments: argparse.Namespace) -> RigLoop:
    rig = load_rig(arguments.rig)
    simulated = SimulatedRig(
        rig,
        truth=load_rig(arguments.true_rig) if arguments.true_rig else None,
        effects=parse_effects(arguments.effect),
        codec=BoardCodec.from_dbc(arguments.dbc),
        board=BoardSettings(
            measurement_rate=arguments.measurement_rate, watchdog_period=arguments.watchdog
        ),
        quality=SensorQuality(
            arguments.pressure_noise,
            arguments.position_noise,
            arguments.pressure_quantum,
            arguments.position_quantum,
        ),
        rate=arguments.rate,
        step=arguments.step,
        seed=arguments.seed,
        now=time.monotonic(),
    )
    options = {} if arguments.port is None else {"port": arguments.port}
    port = open_bus(arguments.interface, arguments.channel, **options)
    loop = RigLoop(simulated, port, arguments.rate)
    loop.schedule(arguments.faults)
    return loop


def _serve(loop: RigLoop, duration: float | None) -> None:
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    end = None if duration is None else time.monotonic() + duration
    told = 0.0
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
                if report["skipped turns"] > told:
                    print(
                        f"the host is late: {report['skipped turns'] - told:.0f} turns in "
                        f"{REPORT_PERIOD:g} s were simulated in larger pieces",
                        file=sys.stderr,
                    )
                    told = report["skipped turns"]
    finally:
        loop.stop()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until a signal; 0 after one, 2 for a user's mistake."""
    parsed = _parser().parse_args(arguments)
    try:
        _serve(_make_loop(parsed), parsed.duration)
    except PamError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
