"""Commissions drawn rigs over ROS topics: simulated boards on a bus, the driver, and the command.

The boards simulate a robot with the true numbers of a drawn rig; driver and commissioning have its
rough rig file. The joint then follows the same test with the identified file and with the true one,
over the same topics. What is compared is therefore what an owner would get, delays included.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pam_check.calibration.campaign import TOLERANCES
from pam_check.calibration.commission_campaign import (
    MOST_SECONDS,
    RATIO,
    TESTS,
    drawn_with_file,
    together,
    true_rig_file,
)
from pam_demo.chain import Chain, multicast_bus, private_domain, set_environment
from pam_demo.commission.commission import OpenPort, commission
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.lower_priority import at_lower_priority
from pam_demo.commission.tracking import Tracked, controller_for, track
from pam_demo.commission.watch import Limits
from pam_demo.demo import COMPILE_TIMEOUT, SIMULATING, START_TIMEOUT, node_settings
from pam_demo.robot import ACTIVE
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Encoder, Rig, save_rig
from pam_model.rig.partial import PartialRig

RATE: Final = 250.0  # Hz, of the commands: the one that `pam demo commission` has by default


@dataclass(frozen=True, slots=True)
class RosResult:
    """One rig.

    Attributes
    ----------
    rig : int
        Number.
    seconds : float
        From the first step to the end of the commissioning, computing included [s].
    most : (float, float, float)
        Largest measured pressure, speed and distance from the middle, over the limits [-].
    before, measured : float
        RMS error that the commissioning measured with the rough and with the identified file [rad];
        infinite where the test was not followed.
    after, true : float
        RMS error of `TESTS` tests with the identified and with the true file [rad].
    said : str
        Why it ended or what it doubts; empty for neither.
    """

    rig: int
    seconds: float
    most: tuple[float, float, float]
    before: float = math.nan
    measured: float = math.nan
    after: float = math.nan
    true: float = math.nan
    said: str = ""

    @property
    def tracks(self) -> bool:
        """Whether the joint tracks as asked."""
        return math.isfinite(self.after) and bool(self.after <= RATIO * self.true)

    def line(self) -> str:
        """For a terminal."""
        pressure, speed, place = self.most
        return (
            f"{self.rig:3d} {self.seconds:4.0f} s, {pressure:.0%} of the pressure, {speed:.0%} of "
            f"the speed, {place:.0%} of the range; before {1e3 * self.before:.2f}, after "
            f"{1e3 * self.after:.2f}, true file {1e3 * self.true:.2f} mrad: "
            f"{self.after / self.true if self.true > 0.0 else math.nan:.2f}"
            + (f"; {self.said[:90]}" if self.said else "")
        )


def on_a_board(partial: PartialRig) -> PartialRig:
    """A rough rig whose valves, sensors and encoder are those of one valve board."""
    rig = partial.rig
    muscles = tuple(
        replace(muscle, board=0, channel=channel) for channel, muscle in enumerate(rig.muscles)
    )
    joints = (replace(rig.joints[0], encoder=Encoder(board=0, channel=0)),)
    return replace(partial, rig=replace(rig, muscles=muscles, joints=joints))


@contextmanager
def simulated_robot(written: Rig, true: Rig, folder: Path) -> Iterator[Chain]:
    """Boards with the numbers of one rig file and a driver with those of another one, active."""
    folder.mkdir(parents=True, exist_ok=True)
    rough, exact = folder / "driver.yaml", folder / "true.yaml"
    save_rig(written, rough)
    save_rig(true, exact)
    settings = node_settings(2.0 * RATE)
    unchecked = {"plausibility": False, "start_up_check": False}
    with Chain([rough], multicast_bus(), private_domain()) as chain:
        boards = chain.start("rig", settings["rig"] | {"true_rig": str(exact)})
        boards.wait_for_output(SIMULATING, COMPILE_TIMEOUT)
        driver = chain.start("driver", settings["driver"] | unchecked)
        driver.wait_for_output(ACTIVE, START_TIMEOUT)
        yield chain
    chain.write_logs(folder)


def _tests(
    rig: Rig, true: Rig, done: Commissioned, folder: Path, open_port: OpenPort
) -> list[Tracked]:
    """The tracking test of a commissioning with one rig file, several times in a row."""
    name = rig.joints[0].name
    with (
        simulated_robot(rig, true, folder) as chain,
        set_environment(chain.environment),
        open_port(rig, name, 1.0 / RATE, "") as port,
    ):
        controller = controller_for(port, rig)
        return [track(port, controller, done.points, Limits.of(rig)) for _ in range(TESTS)]


def _largest(uses: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    pressure, speed, place = np.nanmax(np.array(uses), axis=0).tolist() if uses else [math.nan] * 3
    return pressure, speed, place


def commission_one(rig: int, seed: int, folder: Path, open_port: OpenPort) -> RosResult:
    """Commission one drawn rig over ROS."""
    random = np.random.default_rng([seed, rig])
    own = folder / f"{rig:03d}"
    own.mkdir(parents=True, exist_ok=True)
    drawn, _, partial = drawn_with_file(rig, random, folder)
    partial = on_a_board(partial)
    true = true_rig_file(partial.rig, drawn)
    try:
        return _commissioned(rig, f"{seed} {rig}", partial, true, own, open_port)
    except PamError as error:  # such as a rough file with which no driver starts
        return RosResult(rig, 0.0, _largest([]), said=str(error))


def _commissioned(
    rig: int, task: str, partial: PartialRig, true: Rig, folder: Path, open_port: OpenPort
) -> RosResult:
    name = partial.rig.joints[0].name
    with simulated_robot(partial.rig, true, folder) as chain, set_environment(chain.environment):
        began = time.monotonic()
        with open_port(partial.rig, name, 1.0 / RATE, "") as port:
            done = commission(
                port, partial, name, task, folder, TOLERANCES, lambda _: True, at_lower_priority
            )
        seconds = time.monotonic() - began
    uses = [step.most for step in done.steps]
    if done.rig is None or done.before is None or done.after is None:
        return RosResult(rig, seconds, _largest(uses), said=done.ended or done.doubt)
    found, exact = (
        _tests(one, true, done, folder / place, open_port)
        for one, place in ((done.rig, "identified"), (true, "exact"))
    )
    uses += [one.most for one in (done.before, done.after, *found)]
    stopped = [one.stopped for one in (done.after, *found, *exact)]
    said = dict.fromkeys(text for text in (done.ended or done.doubt, *stopped) if text)
    return RosResult(
        rig, seconds, _largest(uses), done.before.rms, done.after.rms, together(found),
        together(exact), "; ".join(said),
    )  # fmt: skip


def run(given: Arguments, open_port: OpenPort) -> Outcome:
    """Draw and commission; the command of `pam_check.commands.calibration`.

    Parameters
    ----------
    given : Arguments
        Of the command line.
    open_port : callable
        Opens the port to a robot on ROS topics.
    """
    folder = Path(given.out)
    folder.mkdir(parents=True, exist_ok=True)
    results: list[RosResult] = []
    for rig in range(given.first, given.first + given.rigs):
        results.append(commission_one(rig, given.seed, folder, open_port))
        print(results[-1].line(), flush=True)
        content = {"seed": given.seed, "rigs": [asdict(one) for one in results]}
        (folder / "score.json").write_text(json.dumps(content, indent=1), encoding="utf-8")
    bad = [f"rig {r.rig} does not track: {r.said or 'nothing was said'}" for r in results
           if not r.tracks and not r.said]  # fmt: skip
    bad += [f"rig {r.rig} left a limit" for r in results if max(r.most) > 1.0]
    bad += [f"rig {r.rig} took {r.seconds:.0f} s" for r in results if r.seconds > MOST_SECONDS]
    found: dict[str, Any] = {
        "out": str(folder),
        "rigs": len(results),
        "track": sum(one.tracks for one in results),
        "longest": max(one.seconds for one in results),
    }
    print(
        f"{found['track']} of {found['rigs']} track with at most {RATIO:g} times the error with "
        f"the true rig file; longest {found['longest']:.0f} s, computing included"
    )
    return Outcome(found, bad)
