"""What an answer was made from: files with their hashes, versions, command and date."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import pam_gap
import pam_model
from pam_model.effects.registry import effect_files
from pam_model.errors import PamError

_CHUNK = 1 << 20


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file or the folder of a bag, with the hash of its content."""

    path: str
    sha256: str
    size: int


@dataclass(frozen=True, slots=True)
class Provenance:
    """What an answer was made from."""

    rig: SourceFile  # the rig file
    recordings: tuple[SourceFile, ...]  # the recordings
    command: str  # the command line; empty for a call from a script
    versions: tuple[tuple[str, str], ...]  # programs and their versions
    date: str  # time of the answer, UTC, ISO 8601

    def to_json(self) -> dict[str, Any]:
        """The mapping that diagnosis.json holds."""
        return {
            "rig": _as_json(self.rig),
            "recordings": [_as_json(entry) for entry in self.recordings],
            "command": self.command,
            "versions": dict(self.versions),
            "date": self.date,
        }


def _as_json(entry: SourceFile) -> dict[str, Any]:
    return {"path": entry.path, "sha256": entry.sha256, "bytes": entry.size}


def source_file(path: str | Path) -> SourceFile:
    """A file, or all files of a folder in the order of their names, with one hash.

    Raises
    ------
    PamError
        When it cannot be read.
    """
    place = Path(path)
    files = sorted(p for p in place.rglob("*") if p.is_file()) if place.is_dir() else [place]
    digest, size = hashlib.sha256(), 0
    try:
        for file in files:
            with file.open("rb") as content:
                while chunk := content.read(_CHUNK):
                    digest.update(chunk)
                    size += len(chunk)
    except OSError as error:
        raise PamError(f"{path}: cannot be read: {error}") from error
    return SourceFile(str(path), digest.hexdigest(), size)


@cache
def source_hash() -> str:
    """SHA-256 of all source files on which an answer depends: pam_gap, pam_model, own effects.

    Between releases, the version number alone does not distinguish two states of the source.
    """
    digest = hashlib.sha256()
    for package in (pam_gap, pam_model):
        root = Path(str(package.__file__)).parent
        for file in sorted(root.rglob("*.py")):
            digest.update(f"{package.__name__}/{file.relative_to(root).as_posix()}\n".encode())
            digest.update(file.read_bytes())
    for file in effect_files():
        digest.update(f"{file.name}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def provenance(rig: str | Path, recordings: Sequence[str | Path], command: str = "") -> Provenance:
    """Collect what an answer is made from."""
    return Provenance(
        source_file(rig),
        tuple(source_file(path) for path in recordings),
        command,
        (
            ("pam_gap", f"{pam_gap.__version__} (source {source_hash()[:12]})"),
            ("Python", platform.python_version()),
            ("numpy", np.__version__),
            ("scipy", scipy.__version__),
        ),
        datetime.now(UTC).isoformat(timespec="seconds"),
    )
