"""Commissions drawn rigs of the independent plant, and compares with the true rig file.

Asked for each rig: never above a limit of the true robot, ten minutes of its time at most, and a
tracking error of at most 1.5 times that with the file of the true numbers, or a reason. Threads
and bladders remember the motion before: one test after another, with one file and on one robot,
has up to 1.9 times the error of the best one. Both files are therefore tried several times, each on
a copy of the robot as the commissioning leaves it, with the same design of gains. Where
something is exchanged, it has to be told before anything moves far; the check then answers as a
person who has looked at the robot.
"""

from __future__ import annotations

import copy
import json
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from pam_check.blind.variety import draw_variety
from pam_check.calibration.campaign import TOLERANCES
from pam_check.calibration.drawn_rig import (
    EXCHANGES,
    OF_FLOW_VALVES,
    TrueRig,
    draw_exchange,
    draw_true_rig,
    true_numbers,
    written_numbers,
)
from pam_check.calibration.truth_port import TruthPort
from pam_control.references.trajectory import TrajectoryPoint
from pam_demo.commission.commissioned import Commissioned
from pam_demo.commission.exchange import CrossedPort, Mend, rewired
from pam_demo.commission.kept import Kept
from pam_demo.commission.robot_port import RobotPort
from pam_demo.commission.sequence import Commissioning, EndedError
from pam_demo.commission.tracking import Tracked, controller_for, not_possible, track
from pam_demo.commission.watch import Limits
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import Rig, rig_from_parameters
from pam_model.rig.partial import PartialRig, load_partial_rig

PERIOD: Final = 0.004  # s
MOST_SECONDS: Final = 600.0
RATIO: Final = 1.5
FULL: Final = 2e4  # Pa, above which a contact with an end of the range counts
SPEED_TIME: Final = 0.012  # s, over which the true speed is taken
SPARE: Final = 120.0  # s, for which the plant can run on
TESTS: Final = 3  # with each rig file
MENDS: Final = {"hoses": Mend.HOSES, "sign of the joint": Mend.ENCODER}


@dataclass(slots=True)
class Result:
    """One rig.

    Attributes
    ----------
    rig : int
        Number.
    exchanged, ended : str
        What is exchanged, and why the sequence was ended; empty for neither.
    seconds, work : float
        Time of the robot, and of the processor [s].
    pressure, speed : float
        Largest true pressure over the limit, and speed over the limit [-].
    contact : bool
        Whether the joint came to an end of its range with air in a muscle.
    after, true : float
        RMS error of `TESTS` tracking tests with the identified and the true rig file [rad];
        infinite where one was not followed.
    tests : (tuple of float, tuple of float)
        RMS error of each of these tests, with the identified and with the true rig file [rad].
    measured, before : float
        RMS error that the commissioning measured in its test with the identified and with the rough
        rig file [rad]; infinite where it was not followed.
    told : str
        Why the test was not followed with the identified file; empty if it was.
    apart : float
        Largest difference between the references that both files let the controller follow [rad].
    was_told : bool
        Whether the exchange was told.
    warned : str
        What the commissioning says of a tracking that is worse than its numbers predict, or that
        they leave open.
    expected : tuple of float
        RMS errors that its numbers predict, the smallest first [rad]; empty if there are none.
    known : float
        RMS error that a robot with exactly the identified numbers would have [rad].
    """

    rig: int
    exchanged: str
    ended: str
    seconds: float
    work: float
    pressure: float
    speed: float
    contact: bool
    after: float = math.nan
    true: float = math.nan
    tests: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    measured: float = math.nan
    before: float = math.nan
    told: str = ""
    apart: float = math.nan
    was_told: bool = False
    warned: str = ""
    expected: tuple[float, ...] = ()
    known: float = math.nan

    @property
    def is_within_limits(self) -> bool:
        """Whether no true limit was exceeded."""
        return self.pressure <= 1.0 and self.speed <= 1.0 and not self.contact

    @property
    def ratio(self) -> float:
        """Error with the identified rig file over that with the true one [-]."""
        return self.after / self.true if self.true > 0.0 else math.nan

    @property
    def tracks(self) -> bool:
        """Whether the joint tracks as asked."""
        return bool(self.ratio <= RATIO)

    @property
    def says_why(self) -> bool:
        """Whether anything is said of a joint that does not track."""
        return bool(self.ended or self.told or self.warned)

    def line(self) -> str:
        """For a terminal."""
        text = f"{self.rig:3d} {self.exchanged or '-':19s} {self.seconds:4.0f} s, "
        text += f"{self.work:4.0f} s of work, {self.pressure:.0%} of the pressure, "
        text += f"{self.speed:.0%} of the speed"
        text += ", at an END of its range" if self.contact else ""
        if self.ended:
            return f"{text}; {self.ended[:90]}"
        return (
            f"{text}; before {1e3 * self.before:.2f}, after {1e3 * self.after:.2f}, true file "
            f"{1e3 * self.true:.2f} mrad: {self.ratio:.2f}; measured {1e3 * self.measured:.2f}, "
            "expected "
            f"{1e3 * min(self.expected, default=math.nan):.2f} to "
            f"{1e3 * max(self.expected, default=math.nan):.2f}, with exactly these numbers "
            f"{1e3 * self.known:.2f}" + ("; DOUBT" if self.warned else "")
        )


def true_rig_file(written: Rig, drawn: TrueRig) -> Rig:
    """The rig file with the true numbers."""
    tree = written.to_parameters()
    for key, value in true_numbers(drawn.joint, drawn.muscles).items():
        *path, last = key.split(".")
        branch: Any = tree
        for step in path:
            branch = branch[step]
        branch[last] = value
    return rig_from_parameters(tree)


class Owner:
    """A person who sees what is exchanged, and mends what only can be mended at the robot.

    Parameters
    ----------
    port : TruthPort
        The robot.
    exchanged : str
        What is exchanged on it.

    Attributes
    ----------
    was_asked : bool
        Whether the commissioning has asked for anything.
    """

    def __init__(self, port: TruthPort, exchanged: str) -> None:
        self._port, self._exchanged, self.was_asked = port, exchanged, False

    def confirm(self, mend: Mend, _: str) -> bool:
        """The answer to a question of the commissioning."""
        self.was_asked = True
        if mend is Mend.AT_ROBOT and self._exchanged in OF_FLOW_VALVES:
            self._port.mend()
            self._exchanged = ""
            return True
        return MENDS.get(self._exchanged) is mend


def drawn_with_file(
    rig: int, random: np.random.Generator, folder: Path
) -> tuple[TrueRig, str, PartialRig]:
    """A drawn rig, what is exchanged on it, and its rig file, which is written."""
    kind = replace(draw_variety(random, regulators=True), slow=False, rows=1)
    drawn = draw_true_rig(random, kind)
    what = draw_exchange(random, drawn.muscles[0].regulator == 0.0)
    path = folder / f"{rig:03d}.yaml"
    tree = written_numbers(random, drawn.joint, *drawn.muscles)
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}), encoding="utf-8")
    return drawn, what, load_partial_rig(path)


def commission(
    rig: int, random: np.random.Generator, folder: Path, exchanged: str | None = None
) -> tuple[Result, Commissioned]:
    """Draw one rig, commission it, and play the same test with the true rig file.

    Parameters
    ----------
    rig : int
        Its number, which is the seed of the noise.
    random : numpy.random.Generator
        Of the rig.
    folder : Path
        For rig files, recordings and results.
    exchanged : str, optional
        What is exchanged; drawn by default.
    """
    drawn, what, partial = drawn_with_file(rig, random, folder)
    what = what if exchanged is None else exchanged
    text = (folder / f"{rig:03d}.yaml").read_text(encoding="utf-8")
    port = TruthPort(drawn, what, PERIOD, MOST_SECONDS + SPARE, rig)
    lines: list[str] = []
    owner = Owner(port, what)
    began = time.process_time()
    done = Commissioning(
        port, partial, TOLERANCES, Kept(folder / f"{rig:03d}", text),
        lines.append, lambda _: True, confirm=owner.confirm,
    ).run()  # fmt: skip
    result = Result(
        rig, what, done.ended, port.seconds, time.process_time() - began,
        *_use_of_limits(port, Limits.of(partial.rig)), was_told=owner.was_asked,
    )  # fmt: skip
    if done.after is not None and done.points:
        result.measured, result.told, result.warned = done.after.rms, done.after.stopped, done.doubt
        if done.expected is not None:
            result.expected, result.known = done.expected.errors, done.expected.known
        result.before = done.before.rms if done.before else math.nan
        both = _both_files(port, done, true_rig_file(partial.rig, drawn), what)
        result.after, result.true = map(together, both)
        found, true = (tuple(one.rms for one in tests) for tests in both)
        result.tests, result.apart = (found, true), _apart(*both)
    (folder / f"{rig:03d}" / "told.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return result, done


def _both_files(
    port: TruthPort, done: Commissioned, true: Rig, exchanged: str
) -> tuple[list[Tracked], list[Tracked]]:
    """The tests with the identified file, if there is one, and with that of the true numbers."""
    mend = MENDS.get(exchanged)
    if mend is Mend.ENCODER:  # the angle counts as the encoder does
        true = rewired(PartialRig(true), mend).rig
    found = _tests(port, done.rig, done.points, mend) if done.rig is not None else []
    return found, _tests(port, true, done.points, mend)


def together(tests: Sequence[Tracked]) -> float:
    """RMS error of several tests [rad]; infinite without any."""
    return math.sqrt(np.mean([one.rms**2 for one in tests])) if tests else math.inf


def _apart(found: Sequence[Tracked], true: Sequence[Tracked]) -> float:
    """Largest difference between the references that both files let the controller follow [rad]."""
    references = [tests[0].table["reference"].to_numpy() for tests in (found, true) if tests]
    count = min(map(len, references))
    return float(np.ptp([one[:count] for one in references], axis=0).max(initial=0.0))


def _tests(
    port: TruthPort, rig: Rig, points: Sequence[TrajectoryPoint], mend: Mend | None
) -> list[Tracked]:
    """The tracking test, several times in a row, on a copy of the robot as it is now."""
    robot: RobotPort = copy.deepcopy(port)
    if mend is not None:
        robot = CrossedPort.of(robot)
    try:
        controller = controller_for(robot, rig)
        return [track(robot, controller, points, Limits.of(rig)) for _ in range(TESTS)]
    except PamError as error:
        return [not_possible(error)]


def _use_of_limits(port: TruthPort, limits: Limits) -> tuple[float, float, bool]:
    """True pressure and speed over their limits, and whether the joint came to an end."""
    truth = port.truth
    pressure = float((truth[:, :2].max(axis=0) / limits.pressures).max())
    over = max(round(SPEED_TIME / port.period), 1)
    moved = truth[over:, 2] - truth[:-over, 2]
    speed = float(np.abs(moved).max() / (over * port.period) / limits.speed)
    filled = truth[:, :2].max(axis=1) > FULL
    at_end = (truth[:, 2] <= limits.lower + 1e-6) | (truth[:, 2] >= limits.upper - 1e-6)
    return pressure, speed, bool(np.any(filled & at_end))


def score(results: list[Result]) -> dict[str, Any]:
    """The figures of a campaign."""
    swapped = [one for one in results if one.exchanged]
    ratios = [one.ratio for one in results if math.isfinite(one.ratio)]
    misses = [one for one in results if not one.tracks]
    return {
        "rigs": len(results),
        "within_limits": sum(one.is_within_limits for one in results),
        "within_time": sum(one.seconds <= MOST_SECONDS for one in results),
        "longest": max((one.seconds for one in results), default=math.nan),
        "track": sum(one.tracks for one in results),
        "told": sum(one.says_why for one in misses),
        "silent": sum(not one.says_why for one in misses),
        "warned": sum(bool(one.warned) for one in results if one.tracks),
        "exchanged": len(swapped),
        "exchanged_told": sum(one.was_told for one in swapped),
        "exchanged_track": sum(one.tracks for one in swapped),
        "median_ratio": float(np.median(ratios)) if ratios else math.nan,
        "worst_ratio": max(ratios, default=math.nan),
        "work": max((one.work for one in results), default=math.nan),
    }


def text_of(found: dict[str, Any]) -> str:
    """The figures for a terminal."""
    return (
        f"{found['rigs']} rigs: {found['within_limits']} never above a true limit, "
        f"{found['within_time']} within ten minutes (longest {found['longest']:.0f} s)\n"
        f"{found['track']} track with at most {RATIO:g} times the error with the true rig file "
        f"(median {found['median_ratio']:.2f}, worst {found['worst_ratio']:.2f}); of the others "
        f"{found['told']} told why, {found['silent']} did not; of those that track, "
        f"{found['warned']} were told to be worse than their numbers predict\n"
        f"exchanges told: {found['exchanged_told']} of {found['exchanged']}, of which "
        f"{found['exchanged_track']} track in the end; work of the slowest: {found['work']:.0f} s"
    )


def run(given: Arguments) -> Outcome:
    """Draw, commission and score; the command of `pam_check.commands.calibration`."""
    folder = Path(given.out)
    folder.mkdir(parents=True, exist_ok=True)
    results: list[Result] = []
    for rig in range(given.first, given.first + given.rigs):
        random = np.random.default_rng([given.seed, rig])
        result, _ = commission(rig, random, folder)
        results.append(result)
        print(result.line(), flush=True)
        content = {
            "seed": given.seed,
            "score": score(results),
            "rigs": [asdict(r) for r in results],
        }
        (folder / f"score_{given.first:03d}.json").write_text(
            json.dumps(content, indent=1), encoding="utf-8"
        )
    found = score(results)
    print(text_of(found))
    bad = []
    if found["within_limits"] < found["rigs"]:
        bad.append(f"{found['rigs'] - found['within_limits']} robots left a limit")
    if found["silent"]:
        bad.append(f"{found['silent']} do not track and were not told")
    if found["exchanged_told"] < found["exchanged"]:
        bad.append(f"{found['exchanged'] - found['exchanged_told']} exchanges were not told")
    return Outcome({"out": str(folder), **found}, bad)


def run_wiring(given: Arguments) -> Outcome:
    """Only the start-up check, with each exchange; the command of `commands.calibration`."""
    folder = Path(given.out)
    folder.mkdir(parents=True, exist_ok=True)
    right: list[bool] = []
    exchanged: list[bool] = []
    pressure = 0.0
    bad = []
    for rig in range(given.rigs):
        random = np.random.default_rng([given.seed, rig])
        drawn, _, partial = drawn_with_file(rig, random, folder)
        is_flow = drawn.muscles[0].regulator == 0.0
        for what in ("", *EXCHANGES):
            if what in OF_FLOW_VALVES and not is_flow:
                continue
            port = TruthPort(drawn, what, PERIOD, SPARE, rig)
            kept = Kept(folder / f"{rig:03d}_{what.replace(' ', '_')}", "")
            said = ""
            try:
                Commissioning(port, partial, TOLERANCES, kept, silent, lambda _: True).check()
            except EndedError as error:
                said = str(error)
            passed = not said
            limits = Limits.of(partial.rig)
            pressure = max(pressure, _use_of_limits(port, limits)[0])
            (exchanged if what else right).append(passed)
            if passed == bool(what):
                bad.append(f"rig {rig}, {what or 'nothing exchanged'}: {said[:90]}")
    found = {
        "rigs": given.rigs,
        "passed": sum(right),
        "told": len(exchanged) - sum(exchanged),
        "exchanges": len(exchanged),
        "pressure": pressure,
    }
    print(
        f"{found['passed']} of {found['rigs']} rightly wired rigs pass the start-up check; "
        f"{found['told']} of {found['exchanges']} exchanges are found by it, with at most "
        f"{pressure:.1%} of the highest pressure in a muscle"
    )
    return Outcome({"out": str(folder), **found}, bad)


def silent(_: str) -> None:
    """Tell nobody."""
