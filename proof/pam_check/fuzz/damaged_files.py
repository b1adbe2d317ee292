"""Damages every kind of file that others write and the suite reads: only PamError may escape.

The formats of recordings come from the readers' own list, so that a new one is included by itself.
A reader must also be quick, must not take memory for what a damaged header claims, and must say
what is wrong in one short line.
"""

from __future__ import annotations

import json
import os
import random
import resource
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import yaml

from pam_check.fuzz.damage import damaged
from pam_check.fuzz.random_targets import Target, ViolationError
from pam_check.fuzz.sample_logs import ENDINGS, LAYERED, sample
from pam_gap.answer.compare import read_answers
from pam_gap.experiments.files import COMMANDS as EXPERIMENT_TABLE
from pam_gap.experiments.files import DETAILS, read_experiment
from pam_gap.fleet.jobs import many_rigs
from pam_gap.import_log.import_log import columns_of
from pam_gap.inference.evidence import load_evidence
from pam_gap.recordings.column_map import ColumnMap, load_column_map
from pam_gap.recordings.import_recording import import_recording
from pam_model.errors import PamError
from pam_model.identify.measurements import load_measurements
from pam_model.rig import Rig, load_rig, save_rig

LONGEST: Final = 10.0
"""Processor time, of readers in other processes as well, in which a file of a few kilobytes must be
read or refused [s]."""
MOST_MEMORY: Final = 1 << 20
"""How much the process may grow beyond its largest size so far [KiB]."""
LONGEST_MESSAGE: Final = 1500
_ROWS: Final = 120

Read = Callable[[Path], Any]


def log_of(rig: Rig) -> dict[str, Any]:
    """A short log of the first joint with the channels of the contract."""
    joint = rig.joints[0]
    t = 0.01 * np.arange(_ROWS)
    swing = np.sin(5.0 * t)
    log: dict[str, Any] = {"time": t}
    for sign, muscle in zip((1.0, -1.0), joint.muscles, strict=True):
        log[f"pressure_states.{muscle}"] = 2e5 + sign * 5e4 * swing
        log[f"valve_commands.{muscle}"] = 0.3 * sign * np.cos(5.0 * t)
    log[f"joint_states.{joint.name}.position"] = 0.3 * swing
    return log


def _map_text(log: Mapping[str, Any]) -> str:
    channels = {name: {"column": name, "unit": "Pa"} if "pressure" in name else name
                for name in log if name != "time"}  # fmt: skip
    return str(yaml.safe_dump({"time": "time", "channels": channels}))


def _other_files(rig: Rig, folder: Path) -> dict[str, tuple[dict[str, bytes], str, Read]]:
    """Files that are no recordings: those needed, by name; which one is damaged; its reader."""
    save_rig(rig, folder / "rig.yaml")
    (folder / "recording.csv").write_bytes(b"time\n0\n")
    log = log_of(rig)
    points = "pressure [bar],length [mm],force\n" + "\n".join(
        f"{1.0 + k % 3},{200 + k},{100 - k}" for k in range(30)
    )
    answer = {"joint": "elbow", "verdict": "none", "effects": [], "probabilities": {}, "gap": []}
    evidence = folder / "made.npz"
    np.savez(evidence, about=np.array(json.dumps({"format": 6, "scores": []})), floor=np.ones(3))
    details = {
        "name": "a", "instruction": "b", "sample_time": 0.01, "position_gain": 1.0,
        "open_from": None, "open_commands": [0.0, 0.0], "mounting": "",
    }  # fmt: skip
    table = b"position,pressure.a,pressure.b\n" + b"0.1,1e5,2e5\n" * 20
    return {
        "map": ({"map.yaml": _map_text(log).encode()}, "map.yaml", load_column_map),
        "points": ({"points.csv": points.encode()}, "points.csv", load_measurements),
        "rig": ({"spoilt.yaml": (folder / "rig.yaml").read_bytes()}, "spoilt.yaml", load_rig),
        "fleet": (
            {"rigs.csv": b"recording,rig,robot,time\nrecording.csv,rig.yaml,a,2026-01-02\n"},
            "rigs.csv",
            lambda path: many_rigs(path.parent, path),
        ),
        "diagnosis": ({"d.json": json.dumps(answer).encode()}, "d.json", read_answers),
        "evidence": ({"e.npz": evidence.read_bytes()}, "e.npz", load_evidence),
        "experiment": (
            {DETAILS: json.dumps(details).encode(), EXPERIMENT_TABLE: table},
            EXPERIMENT_TABLE,
            lambda path: read_experiment(path.parent),
        ),
        "experiment details": (
            {DETAILS: json.dumps(details).encode(), EXPERIMENT_TABLE: table},
            DETAILS,
            lambda path: read_experiment(path.parent),
        ),
    }


class DamagedFiles:
    """Writes damaged files, and reads them.

    Parameters
    ----------
    rig : Rig
        The rig whose names are used.

    Attributes
    ----------
    kinds : tuple of str
        Every kind of file: the endings of recordings, and names of other files.
    """

    def __init__(self, rig: Rig) -> None:
        self._home = TemporaryDirectory(prefix="pam_fuzz_")
        self._folder = Path(self._home.name)
        self._log = log_of(rig)
        self._sound = {ending: sample(ending, self._log) for ending in ENDINGS}
        self._others = _other_files(rig, self._folder)
        (self._folder / "sound_map.yaml").write_text(_map_text(self._log))
        self._map = load_column_map(self._folder / "sound_map.yaml")
        self.kinds = (*ENDINGS, *self._others)

    def recording(self, ending: str) -> Path:
        """A sound recording with this ending."""
        path = self._folder / f"sound{ending}"
        path.write_bytes(self._sound[ending])
        return path

    def check(self, kind: str, draw: random.Random) -> None:
        """Damage one file of a kind and read it.

        Raises
        ------
        ViolationError
            When the reader is slow, takes much memory or is verbose. Whatever else escapes from the
            reader but PamError is a finding, too.
        """
        if kind in self._others:
            files, name, read = self._others[kind]
            for beside, content in files.items():
                (self._folder / beside).write_bytes(content)
            path = self._folder / name
            path.write_bytes(damaged(draw, files[name]))
        else:
            path = self._folder / f"log{kind}"
            path.write_bytes(self._damaged(kind, draw))
            mapped: ColumnMap | None = draw.choice((None, self._map))
            read = draw.choice((columns_of, lambda file: import_recording(file, None, mapped)))
        self._read(path, read, lines=kind == "rig")

    def _damaged(self, ending: str, draw: random.Random) -> bytes:
        if ending not in LAYERED or draw.random() < 0.5:
            return damaged(draw, self._sound[ending])
        return sample(ending, self._log, lambda data: damaged(draw, data))

    @staticmethod
    def _read(path: Path, read: Read, *, lines: bool) -> None:
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        begin = _processor_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                read(path)
        except PamError as error:
            if len(str(error)) > LONGEST_MESSAGE and not lines:
                raise ViolationError(f"a message of {len(str(error))} characters") from error
            reasons = str(error).split("\n")
            if not lines and not all(line.startswith(str(path.parent)) for line in reasons):
                raise ViolationError(f"a line that names no file first: {error}") from error
        took = _processor_time() - begin
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
        if took > LONGEST:
            raise ViolationError(f"{path.name}: {took:.1f} s of a processor")
        if grown > MOST_MEMORY:
            raise ViolationError(f"{path.name}: grew by {grown >> 10} MiB")


def _processor_time() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def files_target(rig: Rig) -> Target:
    """Damaged files of every kind are read as far as they are sound, or refused line by line."""
    files = DamagedFiles(rig)

    def target(draw: random.Random) -> None:
        files.check(draw.choice(files.kinds), draw)

    return target
