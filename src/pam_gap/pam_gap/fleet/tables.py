"""The results of a fleet as Parquet tables: one row for each joint, and one for each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

RECORDINGS, PARAMETERS = "recordings.parquet", "parameters.parquet"
FOUND, FOLLOWED = "diagnosis", "followed"
"""Whether a value is that of the verdict, or of the same effects fitted on every recording."""
_RECORDING_COLUMNS = {
    "recording": "str", "robot": "str", "joint": "str", "time": "float64", "time_from": "str",
    "verdict": "str", "stage": "str", "effects": "str", "sentence": "str", "closed": "float64",
    "failure": "str", "seconds": "float64", "recording_sha256": "str", "rig_sha256": "str",
    "version": "str",
}  # fmt: skip
_PARAMETER_COLUMNS = {
    "recording": "str", "robot": "str", "joint": "str", "time": "float64", "source": "str",
    "effect": "str", "parameter": "str", "value": "float64", "low": "float64", "high": "float64",
    "unit": "str",
}  # fmt: skip


def recording_rows(name: str, robot: str, result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One row for each joint of a recording, or one with the reason of a failure."""
    key = result["key"]
    common = {
        "recording": name, "robot": robot, "time": result["time"],
        "time_from": result["time_from"], "failure": result["failure"],
        "seconds": result.get("seconds"), "recording_sha256": key.get("recording", ""),
        "rig_sha256": key.get("rig", ""), "version": key.get("version", ""),
    }  # fmt: skip
    nothing = {
        "joint": "", "verdict": "", "stage": "", "effects": "", "sentence": "", "closed": None,
    }  # fmt: skip
    if not result["joints"]:
        return [common | nothing]
    return [
        common
        | {
            "joint": answer["joint"],
            "verdict": answer["verdict"],
            "stage": answer["stage"] or "",
            "effects": " + ".join(answer["effects"]),
            "sentence": answer["sentence"],
            "closed": None if answer["closed"] is None else answer["closed"]["value"],
        }
        for answer in result["joints"]
    ]


def found_rows(name: str, robot: str, result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One row for each parameter of a verdict."""
    return [
        {
            "recording": name, "robot": robot, "joint": answer["joint"], "time": result["time"],
            "source": FOUND, "effect": effect, "parameter": parameter,
            **{key: entry[key] for key in ("value", "low", "high", "unit")},
        }
        for answer in result["joints"]
        for effect, parameters in answer["parameters"].items()
        for parameter, entry in parameters.items()
    ]  # fmt: skip


def write_tables(
    folder: Path, recordings: Sequence[Mapping[str, Any]], parameters: Sequence[Mapping[str, Any]]
) -> None:
    """Write both tables; times become UTC dates."""
    for name, rows, columns in (
        (RECORDINGS, recordings, _RECORDING_COLUMNS),
        (PARAMETERS, parameters, _PARAMETER_COLUMNS),
    ):
        table = pd.DataFrame(list(rows), columns=list(columns)).astype(columns)
        table["time"] = pd.to_datetime(table["time"], unit="s", utc=True)
        part = folder / f"{name}.part"
        table.to_parquet(part, index=False)
        part.replace(folder / name)
