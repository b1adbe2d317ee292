"""The file with what repetitions taught: motions by name, for one rig file.

What was learnt for another rig file is worth nothing, because the model gives another torque. The
file therefore contains a digest of the rig's parameters, and is ignored if it differs.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pam_control.learning.repeated_motion import Learnt
from pam_model.errors import PamError
from pam_model.rig import Rig

LARGEST_FILE = 200_000_000  # bytes


def rig_digest(rig: Rig) -> str:
    """Digest of all parameters of a rig."""
    text = json.dumps(rig.to_parameters(), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


class LearntFile:
    """Motions by name, each with what was learnt of every joint.

    Parameters
    ----------
    path : Path
        JSON; it need not exist.
    rig : Rig
        The present rig.

    Attributes
    ----------
    note : str
        Why nothing was read; empty if something was, or if there is no file.

    Raises
    ------
    PamError
        For a file that is none of these.
    """

    def __init__(self, path: Path, rig: Rig) -> None:
        self._path, self._digest, self.note = path, rig_digest(rig), ""
        self._motions: dict[str, dict[str, Learnt]] = {}
        try:
            if path.is_dir():
                raise ValueError("a folder")
            if not path.is_file():
                return
            if path.stat().st_size > LARGEST_FILE:
                raise ValueError("too large")
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["rig"] != self._digest:
                self.note = f"{path}: learnt for another rig file; it is learnt anew"
                return
            self._motions = {
                name: {joint: _learnt(entry) for joint, entry in joints.items()}
                for name, joints in content["motions"].items()
            }
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise PamError(f"{path}: not a file of learnt motions ({error})") from None

    def motion(self, name: str) -> Mapping[str, Learnt]:
        """What is known of a motion, by joint."""
        return self._motions.get(name, {})

    def keep(self, name: str, joint: str, learnt: Learnt) -> None:
        """Write what was learnt of a joint's motion.

        Raises
        ------
        OSError
            When the file cannot be written.
        """
        self._motions.setdefault(name, {})[joint] = learnt
        content = {
            "rig": self._digest,
            "motions": {
                motion: {joint: _entry(each) for joint, each in joints.items()}
                for motion, joints in self._motions.items()
            },
        }
        self._path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=".", suffix=".part", dir=self._path.parent)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump(content, file)
                file.flush()
                os.fsync(file.fileno())  # the new content is on the disk before the old one goes
            Path(temporary).replace(self._path)  # whole or not at all
        except OSError:  # a full disk must not be filled with what is left of every attempt
            Path(temporary).unlink(missing_ok=True)
            raise


def _entry(learnt: Learnt) -> dict[str, object]:
    return {
        "path": np.round(learnt.path, 7).tolist(),
        "base": np.round(learnt.base, 7).tolist(),
        "correction": np.round(learnt.correction, 7).tolist(),
        "error": None if math.isnan(learnt.error) else learnt.error,
    }


def _learnt(entry: Mapping[str, object]) -> Learnt:
    path, base, correction = (
        np.array(entry[part], dtype=np.float64) for part in ("path", "base", "correction")
    )
    if not path.ndim == base.ndim == correction.ndim == 1 or not (
        path.size == base.size == correction.size > 0
    ):
        raise ValueError("arrays of different size")
    if not all(np.isfinite(each).all() for each in (path, base, correction)):
        raise ValueError("a number is not finite")
    error = entry["error"]
    return Learnt(path, base, correction, math.nan if error is None else float(str(error)))
