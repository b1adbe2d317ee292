"""Store of designed gains, for equal joints and for the next start of the node.

A design depends only on its task: the numbers of the linearised loops, their delays and the
requirements. Therefore the task is the key: any change in the rig file, the parameters or the
physics that changes a loop also changes the key. On disk the key also contains the code of the
design and the versions of the libraries that are used in the search. Whether a loop with given
gains is stable is stored in the same way.

A stored design is checked before it is used: it must belong to the same task, its numbers must be
finite, and the cost (which includes the margins), computed again, must agree with the stored cost.
Otherwise the gains are designed again. If the folder cannot be read or written, the only
consequence is the time of a new design.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from pam_control.feedback.gain_design import INFEASIBLE, DesignTask, PidCost, design_pid
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.linear_joint import LoopTiming
from pam_control.feedback.margins import ControlDesignError, LoopCase
from pam_control.feedback.observer_design import ObserverCost, design_with_observer
from pam_control.feedback.pid import PidGains
from pam_control.feedback.separate_process import LONGEST, SeparateProcess
from pam_model.views import linearised_joint
from pam_ros.missing_packages import what_to_install

LARGEST_FILE = 1_000_000  # bytes; a design of 9 operating points takes 5 kB
MOST_FILES = 512
LARGEST_GAIN = 1e12  # plausibility limit of stored gains, far above any design
GAINS, POLES = ".gains.json", ".poles.json"  # suffixes of the files
CODE = (
    "closed_loop",
    "gain_design",
    "gain_schedule",
    "linear_joint",
    "loop_shape",
    "margins",
    "motion_observer",
    "observer_design",
)
COST_TOLERANCE = 1e-6  # relative; covers the rounding differences between processors


def user_cache_folder(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Folder of a user's designs: $XDG_CACHE_HOME/pam_control or ~/.cache/pam_control.

    None if there is no home folder.
    """
    given = Path(environment.get("XDG_CACHE_HOME", ""))
    if given.is_absolute():  # the XDG specification says to ignore a relative path
        return given / "pam_control"
    home = Path(environment.get("HOME", ""))
    return home / ".cache" / "pam_control" if home.is_absolute() else None


@dataclasses.dataclass(slots=True)
class DesignReport:
    """Summary of the requested designs."""

    # designed, shared, read: number of designs, one for each joint and stiffness, that were made
    # anew, taken from an equal joint, or read from disk
    designed: int = 0
    shared: int = 0
    read: int = 0
    seconds: float = 0.0  # total time [s]
    problem: str = ""  # why designs cannot be stored on disk; empty if they can

    def __str__(self) -> str:
        """One line for a log."""
        parts = [f"{self.designed} designed"]
        if self.shared:
            parts.append(f"{self.shared} shared by equal joints")
        if self.read:
            parts.append(f"{self.read} read from an earlier start")
        text = f"gains took {self.seconds:.1f} s: {', '.join(parts)}"
        return f"{text}; not kept for the next start: {self.problem}" if self.problem else text


class KeptDesigns:
    """Designs of this process and, if a folder is given, of earlier processes.

    Parameters
    ----------
    folder : Path, optional
        Created when the first design is written. None: designs are kept in memory only.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._found: dict[DesignTask, PidGains] = {}
        self._stable: dict[Any, list[bool]] = {}
        self._report = DesignReport()
        self._process: SeparateProcess | None = None

    def compute_in(self, process: SeparateProcess) -> None:
        """Compute what is not kept in another process from now on: a loop of this one will run."""
        self._process = process

    def compute[T](self, function: Callable[..., T], *arguments: Any, within: float = LONGEST) -> T:
        """The result of a function of a module, which must not hold up the loop.

        Parameters
        ----------
        function : callable
            Computed in the other process, if there is one.
        *arguments
            Its arguments.
        within : float, optional
            The other process gives up after this time [s].

        Raises
        ------
        PamError
            The one of the function, or one that says that it took too long.
        """
        if self._process is None:
            return function(*arguments)
        return self._process.call_within(within, function, *arguments)

    def take_report(self) -> DesignReport:
        """Return the summary since the last call."""
        report, self._report = self._report, DesignReport()
        return report

    def pid(self, joint: str, task: DesignTask) -> PidGains:
        """The gains for a task.

        Parameters
        ----------
        joint : str
            Name for messages.
        task : DesignTask
            Its loops and the requirements.

        Raises
        ------
        ControlDesignError
            When no gains satisfy the constraints.
        """
        start = time.monotonic()
        try:
            return self._pid(joint, task)
        finally:
            self._report.seconds += time.monotonic() - start

    def _pid(self, joint: str, task: DesignTask) -> PidGains:
        gains = self._found.get(task)
        if gains is not None:
            self._report.shared += 1
            return gains
        gains = self._read(task)
        if gains is not None:
            self._report.read += 1
        else:
            gains = self.compute(_design, joint, task)
            self._report.designed += 1
            self._write(task, gains)
        self._found[task] = gains
        return gains

    def stable(
        self, cases: Sequence[LoopCase], timing: LoopTiming, gains: GainSchedule
    ) -> list[bool]:
        """Whether the poles of each of these closed loops lie in the left half plane."""
        loop = (tuple(cases), timing, gains)
        if loop in self._stable:
            return self._stable[loop]
        content = {
            "cases": [dataclasses.asdict(case) for case in cases],
            "timing": dataclasses.asdict(timing),
            "gains": dataclasses.asdict(gains),
        }
        key = _key_of(content)
        kept = (self._load(key, POLES) or {}).get("stable")
        if isinstance(kept, list) and len(kept) == len(cases):
            found = [answer is True for answer in kept]
        else:
            found = self.compute(_stable, cases, timing, gains)
            self._store(key, POLES, {"stable": found})
        self._stable[loop] = found
        return found

    def _read(self, task: DesignTask) -> PidGains | None:
        kept = self._load(_key_of(dataclasses.asdict(task)), GAINS)
        if kept is None:
            return None
        try:
            numbers = [float(kept["gains"][part]) for part in ("kp", "ki", "kd", "observer")]
            written = float(kept["cost"])
        except (ValueError, TypeError, KeyError, OverflowError):
            return None
        if not all(0.0 <= value < LARGEST_GAIN for value in numbers):
            return None
        kp, ki, kd, observer = numbers
        gains = dataclasses.replace(task.gains(kp, ki, kd), observer=observer)
        cost = _cost(task, gains)
        reached = cost < INFEASIBLE and math.isclose(cost, written, rel_tol=COST_TOLERANCE)
        return gains if reached else None

    def _write(self, task: DesignTask, gains: PidGains) -> None:
        numbers = {
            "kp": gains.proportional,
            "ki": gains.integral,
            "kd": gains.derivative,
            "observer": gains.observer,
        }
        content = {"gains": numbers, "cost": _cost(task, gains)}
        self._store(_key_of(dataclasses.asdict(task)), GAINS, content)

    def _load(self, key: Mapping[str, Any], suffix: str) -> dict[str, Any] | None:
        """The content of the file with this key; None without a usable one."""
        if self._folder is None:
            return None
        try:
            with (self._folder / _name_of(key, suffix)).open("rb") as file:
                kept = json.loads(file.read(LARGEST_FILE))
        except (OSError, ValueError, RecursionError):
            return None
        return kept if isinstance(kept, dict) and kept.get("key") == key else None

    def _store(self, key: Mapping[str, Any], suffix: str, content: Mapping[str, Any]) -> None:
        if self._folder is None:
            return
        temporary: Path | None = None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(prefix=".", suffix=".part", dir=self._folder)
            temporary = Path(name)
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump({**content, "key": key}, file)
            # atomic, since other processes may read or write the file at the same time
            temporary.replace(self._folder / _name_of(key, suffix))
            self._forget_oldest()
        except OSError as error:
            self._report.problem = f"{error.strerror or error}: {self._folder}"
            if temporary is not None:
                with contextlib.suppress(OSError):
                    temporary.unlink(missing_ok=True)

    def _forget_oldest(self) -> None:
        """Delete the oldest designs; other files are not touched."""
        assert self._folder is not None
        own = (path for path in self._folder.iterdir() if path.name.endswith((GAINS, POLES)))
        files = sorted(own, key=lambda path: path.stat().st_mtime)
        for path in files[:-MOST_FILES]:
            path.unlink(missing_ok=True)


def _design(joint: str, task: DesignTask) -> PidGains:
    design = design_with_observer if task.has_observer else design_pid
    return design(joint, task)


def _stable(cases: Sequence[LoopCase], timing: LoopTiming, gains: GainSchedule) -> list[bool]:
    try:  # python-control takes more than a second to import, and is optional
        from pam_control.feedback.closed_loop import is_stable  # noqa: PLC0415
    except ModuleNotFoundError as error:
        told = what_to_install(error)
        if told is None:
            raise
        raise ControlDesignError(told) from None

    return [is_stable(case, timing, gains.at(case.scheduled)) for case in cases]


def _cost(task: DesignTask, gains: PidGains) -> float:
    cost = ObserverCost(task) if task.has_observer else PidCost(task)
    return cost.of(gains)


def _key_of(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content and code as JSON returns them: exact numbers, and lists in place of tuples."""
    key: dict[str, Any] = json.loads(json.dumps(content))
    key["code"] = code_version()
    return key


def _name_of(key: Mapping[str, Any], suffix: str) -> str:
    text = json.dumps(key, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest() + suffix


@functools.cache
def code_version() -> str:
    """Digest of the code and library versions that lead from a task to its gains."""
    digest = hashlib.sha256(f"numpy {np.__version__}, scipy {scipy.__version__}".encode())
    for name in CODE:
        digest.update(Path(__file__).with_name(f"{name}.py").read_bytes())
    digest.update(Path(linearised_joint.__file__).read_bytes())
    return digest.hexdigest()
