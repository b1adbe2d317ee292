"""The file with what repetitions taught: motions by name, for one rig file.

What was learnt for another rig file is useless, because the model gives another torque. The
file therefore contains a digest of the rig's parameters, and is ignored if it differs.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pam_control.learning.repeated_motion import Learnt
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.foreign_text import shown

LARGEST_FILE = 20_000_000  # bytes; some 600,000 samples, or 20 min of one joint at 500 Hz
LONGEST_READING = 10.0  # s


def rig_digest(rig: Rig) -> str:
    """Digest of all parameters of a rig."""
    text = json.dumps(rig.to_parameters(), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


Motions = dict[str, dict[str, Learnt]]


def read_motions(path: Path, digest: str) -> tuple[Motions, str]:
    """Motions by name and joint, and why there are none.

    Parameters
    ----------
    path : Path
        JSON; it need not exist.
    digest : str
        Of the present rig.

    Raises
    ------
    PamError
        For a file that is none of these.
    """
    try:
        if not path.exists():
            return {}, ""
        if not path.is_file():
            raise ValueError("no ordinary file")
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"larger than {LARGEST_FILE} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["rig"] != digest:
            return {}, f"{path}: learnt for another rig file; learning starts again"
        motions = {
            str(name): {str(joint): _learnt(entry) for joint, entry in joints.items()}
            for name, joints in content["motions"].items()
        }
    except (RecursionError, MemoryError):
        raise PamError(f"{path}: not a file of learnt motions (nested too deeply)") from None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        reason = shown(" ".join(str(error).split()))
        raise PamError(f"{path}: not a file of learnt motions ({reason})") from None
    return motions, ""


def _read_here(function: Callable[..., Any], *arguments: Any, within: float) -> Any:
    return function(*arguments)


class LearntFile:
    """Motions by name, each with what was learnt of every joint.

    Parameters
    ----------
    path : Path
        JSON; it need not exist.
    read : callable, optional
        Calls a function with its arguments and a limit of time `within` [s]: a large file must not
        be read in the process of the control loop.

    Attributes
    ----------
    note : str
        Why nothing was read; empty if something was, or if there is no file.

    Raises
    ------
    PamError
        For a file that is none of these, or takes too long.
    """

    def __init__(self, path: Path, rig: Rig, read: Callable[..., Any] = _read_here) -> None:
        self._path, self._digest = path, rig_digest(rig)
        found: tuple[Motions, str] = read(read_motions, path, self._digest, within=LONGEST_READING)
        self._motions, self.note = found

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
            if Path(temporary).stat().st_size > LARGEST_FILE:
                raise OSError(errno.EFBIG, f"it would have more than {LARGEST_FILE} bytes")
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
    error = math.nan if entry["error"] is None else float(str(entry["error"]))
    if math.isinf(error):
        raise ValueError("a number is not finite")
    return Learnt(path, base, correction, error)
