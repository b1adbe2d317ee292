"""What a commissioning keeps as it goes: recordings, and how far it has come.

A commissioning that was interrupted goes on after the last recording that is complete. It begins
anew for another rig file, other settings or another robot: recordings of a simulated one must not
pass for those of the real one.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pandas as pd

from pam_demo.commission.exchange import Mend
from pam_model.reading import reading

STATE, RECORDINGS = "state.json", "recordings"


class Kept:
    """The folder of one commissioning.

    Parameters
    ----------
    folder : Path
        It is made.
    task : str
        Robot, rig file and settings; what was kept for other ones is not used.

    Attributes
    ----------
    checked : bool
        Whether the start-up check was passed.
    exchanged : str
        What the rig file describes otherwise than it was written (`exchange.Mend`); or empty.
    seconds : float
        Time of the recordings [s].
    """

    def __init__(self, folder: Path, task: str) -> None:
        self.folder = folder
        (folder / RECORDINGS).mkdir(parents=True, exist_ok=True)
        self._digest = hashlib.sha256(task.encode()).hexdigest()
        self.checked, self.exchanged, self.seconds = False, "", 0.0
        self._names: list[str] = []
        path = folder / STATE
        if path.is_file():
            with reading(path, "the state of a commissioning"):
                state = json.loads(path.read_text(encoding="utf-8"))
                if state["task"] == self._digest:
                    self.checked = state["checked"] is True
                    self.exchanged = state.get("exchanged", "") and Mend(state["exchanged"]).value
                    self.seconds = float(state["seconds"])
                    self._names = [str(name) for name in state["recordings"]]

    def _path(self, name: str) -> Path:
        return self.folder / RECORDINGS / f"{name}.csv"

    def _write(self) -> None:
        state = {"task": self._digest, "checked": self.checked, "exchanged": self.exchanged,
                 "seconds": self.seconds, "recordings": self._names}  # fmt: skip
        path = self.folder / STATE
        new = path.with_suffix(".new")
        new.write_text(json.dumps(state, indent=1) + "\n", encoding="utf-8")
        new.replace(path)

    def check(self) -> None:
        """Remember that the start-up check was passed."""
        self.checked = True
        self._write()

    def exchange(self, what: str) -> None:
        """Remember what the rig file describes otherwise than it was written."""
        self.exchanged = what
        self._write()

    def __contains__(self, name: str) -> bool:
        """Whether there is a recording of before."""
        return name in self._names

    def recording(self, name: str) -> pd.DataFrame | None:
        """A recording of before; None if there is none."""
        if name not in self._names:
            return None
        path = self._path(name)
        with reading(path, "a recording of this commissioning"):
            table = pd.read_csv(path)
            return table.astype(dict.fromkeys(("time", *table.columns), float))

    def add(self, name: str, table: pd.DataFrame) -> None:
        """Keep a complete recording."""
        table.to_csv(self._path(name), index=False, float_format="%.7g")
        self.seconds += float(table["time"].iloc[-1])
        self._names.append(name)
        self._write()

    def failed(self, name: str, table: pd.DataFrame) -> None:
        """Keep the recording of a motion that was ended, which is not used."""
        table.to_csv(self._path(f"{name}_ended"), index=False, float_format="%.7g")
        self.seconds += float(table["time"].iloc[-1]) if len(table) else 0.0
        self._write()

    def track(self, name: str, table: pd.DataFrame) -> None:
        """Keep a tracking test."""
        table.to_csv(self._path(f"tracking_{name}"), index=False, float_format="%.7g")
        self.seconds += float(table["time"].iloc[-1]) if len(table) else 0.0
        self._write()
