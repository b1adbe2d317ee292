"""Calibrates drawn rigs and compares the numbers that are found with the true ones.

A log of pressures and angles fixes ratios of numbers: torques, volumes and conductances all grow
with the pull of the muscles. Numbers that are found relative to others are therefore compared as
their ratio to the torque per pressure, of the found rig and of the true one.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from pam_check.calibration.drawn_rig import (
    EXCHANGES,
    OF_FLOW_VALVES,
    CalibrationRig,
    angle_error,
    draw_rig,
    exchange,
)
from pam_gap.calibration.calibration import (
    DETERMINED,
    KEPT,
    NARROWED,
    CalibratedNumber,
    Calibration,
    calibrate_joint,
    exchanges,
)
from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.free_numbers import Said
from pam_gap.diagnose_recordings import usable_parts
from pam_gap.inference.confidence import NORMAL_90
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording, from_columns
from pam_gap.recordings.resample import resample
from pam_model.command_line import Arguments, Outcome
from pam_model.rig.partial import PartialRig, load_partial_rig

TOLERANCES = Said(1.0 / 3.0, 0.05)
GOAL, LEAST, MOST = 0.03, 0.85, 0.95
"""Median error of determined numbers, and coverage of 90 % intervals, that are aimed at."""


@dataclass(frozen=True, slots=True)
class Compared:
    """One number of one rig beside its true value.

    Attributes
    ----------
    rig : int
        Number of the rig.
    key, status : str
        As in `CalibratedNumber`.
    written_error, error : float
        Relative error of the number as written and as found; of an angle in rad. NaN if missing.
    holds : bool
        Whether the 90 % interval contains the true value.
    ratio_error : float
        Error of the ratio to the torque per pressure; NaN for numbers without one.
    ratio_holds : bool
        Whether its 90 % interval contains the true ratio.
    deviations, ratio_deviations : float
        Errors over the standard deviations that the intervals state; NaN without one.
    """

    rig: int
    key: str
    status: str
    written_error: float
    error: float
    holds: bool
    ratio_error: float
    ratio_holds: bool
    deviations: float
    ratio_deviations: float


def torque_per_pressure(numbers: Mapping[str, float]) -> float:
    """Mean over both muscles of r (3 L^2 - b^2)/(4 pi n^2) at position 0 [m^3]."""
    total = 0.0
    for muscle in ("elbow_flexor", "elbow_extensor"):
        b, turns = numbers[f"{muscle}.thread_length"], numbers[f"{muscle}.turns"]
        length = numbers[f"{muscle}.neutral_length"]
        total += (3.0 * length**2 - b**2) / (4.0 * math.pi * turns**2)
    return 0.5 * numbers["elbow.pulley_radius"] * total


def over_deviation(true: float, value: float, ends: tuple[float, float]) -> float:
    """Error over the standard deviation that a 90 % interval states."""
    reach = ends[1] - value if true > value else value - ends[0]
    return (value - true) / max(reach / NORMAL_90, 1e-300)


def compare(
    rig: int, found: Sequence[CalibratedNumber], truth: Mapping[str, float]
) -> list[Compared]:
    """Every number of a calibration whose true value is known."""
    values = {one.key: one.value for one in found}
    missing = {key: value for key, value in truth.items() if key not in values}
    scale = torque_per_pressure(values | missing) / torque_per_pressure(truth)
    rows = []
    for one in found:
        if one.key not in truth:
            continue
        true = truth[one.key]
        has_ratio = one.relative is not None
        goal = scale * true  # what the number is in a rig of the found torque per pressure
        if one.unit == "rad":
            written = math.nan if one.written is None else angle_error(one.written, true)
            error = angle_error(one.value, true)
        else:
            written = math.nan if one.written is None else one.written / true - 1.0
            error = one.value / true - 1.0
        rows.append(
            Compared(
                rig, one.key, one.status, written, error,
                bool(one.low <= true <= one.high),
                one.value / goal - 1.0 if has_ratio else math.nan,
                one.relative is None or one.relative[0] <= goal <= one.relative[1],
                over_deviation(true, one.value, (one.low, one.high)),
                math.nan if one.relative is None else over_deviation(goal, one.value, one.relative),
            )
        )  # fmt: skip
    return rows


def as_recording(table: pd.DataFrame, name: str) -> Recording:
    """A drawn log as the import of a table makes it."""
    columns = {c: table[c].to_numpy(dtype=float) for c in table.columns if c != "time"}
    return resample(from_columns(Path(name), table["time"].to_numpy(dtype=float), columns))


def calibrate(drawn: CalibrationRig, partial: PartialRig) -> Calibration:
    """Calibrate one drawn rig."""
    return calibrate_joint(
        partial,
        0,
        [as_recording(drawn.log, "log")],
        [as_recording(drawn.withheld, "withheld")],
        said=TOLERANCES,
        rules=CalibrationRules(),
    )


def exchanges_told(drawn: CalibrationRig, partial: PartialRig) -> list[bool]:
    """Whether each exchange that could have been made on a rig would be told, from its wiring."""
    rig, found = partial.rig, []
    is_flow = rig.muscles[0].valve.kind == "flow"
    for what in EXCHANGES:
        if is_flow or what not in OF_FLOW_VALVES:
            recording = as_recording(exchange(drawn.log, what), what)
            found.append(
                bool(exchanges(PredictionProblem(rig, 0, usable_parts(rig, 0, [recording]))))
            )
    return found


def coverage(rows: Sequence[bool]) -> dict[str, float]:
    """Share of intervals that hold, and their count."""
    return {"share": float(np.mean(rows)) if rows else math.nan, "of": float(len(rows))}


def median(errors: Sequence[float]) -> float:
    """Median of absolute errors; NaN for none."""
    known = [abs(e) for e in errors if math.isfinite(e)]
    return float(np.median(known)) if known else math.nan


def by_number(rows: Sequence[Compared]) -> dict[str, dict[str, float]]:
    """Median error, coverage and what is said, by key without the names of joint and muscle.

    Errors and coverage are of numbers that are not kept; those of ratios, where a number has one.
    """
    found: dict[str, dict[str, float]] = {}
    kind = {row.key: re.sub(r"^elbow(_flexor|_extensor)?\.", "", row.key) for row in rows}
    for name in dict.fromkeys(kind.values()):
        own = [row for row in rows if kind[row.key] == name]
        said = [row for row in own if row.status != KEPT]
        ratios = [row for row in said if math.isfinite(row.ratio_error)]
        found[name] = {
            "count": float(len(own)),
            "kept": float(len(own) - len(said)),
            "determined": float(sum(row.status == DETERMINED for row in own)),
            "error": median([row.error for row in said]),
            "covered": coverage([row.holds for row in said])["share"],
            "ratio_error": median([row.ratio_error for row in ratios]),
            "ratio_covered": coverage([row.ratio_holds for row in ratios])["share"],
        }
    return found


def score(rows: Sequence[Compared], rigs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The figures of a campaign.

    Parameters
    ----------
    rows : sequence of Compared
        All numbers of the rigs on which nothing is exchanged.
    rigs : sequence of mapping
        What was found of each rig.
    """
    relative = [r for r in rows if r.status != KEPT and math.isfinite(r.ratio_error)]
    lengthwise = [r for r in rows if r.status == DETERMINED and not r.key.endswith("angle")]
    swapped = [rig for rig in rigs if rig["exchanged"]]
    right = [rig for rig in rigs if not rig["exchanged"]]
    return {
        "rigs": len(rigs),
        "status": dict(Counter(r.status for r in rows)),
        "written": median([r.written_error for r in rows if not r.key.endswith("angle")]),
        "determined": median([r.error for r in lengthwise]),
        "relative": median([r.ratio_error for r in relative if r.status != NARROWED]),
        "narrowed": median([r.error for r in rows if r.status == NARROWED]),
        "angles": median([r.error for r in rows if r.key.endswith("angle") and r.status != KEPT]),
        "coverage": coverage([r.holds for r in rows if r.status != KEPT]),
        "coverage_determined": coverage([r.holds for r in rows if r.status == DETERMINED]),
        "coverage_relative": coverage([r.ratio_holds for r in relative]),
        "exchanged_told": [sum(rig["told"] for rig in swapped), len(swapped)],
        "exchanges_tried": [
            sum(map(sum, (rig["tried"] for rig in right))),
            sum(len(rig["tried"]) for rig in right),
        ],
        "wrongly_refused": [sum(rig["refused"] for rig in right), len(right)],
        "withheld_before": median([rig["before"] for rig in right]),
        "withheld_after": median([rig["after"] for rig in right]),
        "seconds": max((rig["seconds"] for rig in rigs), default=math.nan),
        "by_number": by_number(rows),
    }


def table_of(numbers: Mapping[str, Mapping[str, float]]) -> list[str]:
    """The figures of each number as lines; errors of angles in mrad, of all others in %."""
    head = "number, kept of all, determined, error, interval holds, error of the ratio, it holds"
    lines = [head]
    for name, one in numbers.items():
        error = (1e3 if name.endswith("angle") else 1e2) * one["error"]
        lines.append(
            f"{name:24s} {one['kept']:3.0f} of {one['count']:3.0f} {one['determined']:3.0f} "
            f"{error:6.1f} {100 * one['covered']:4.0f} % {100 * one['ratio_error']:6.1f} "
            f"{100 * one['ratio_covered']:4.0f} %"
        )
    return lines


def text_of(result: Mapping[str, Any]) -> str:
    """The figures for a terminal."""

    def cover(name: str) -> str:
        one = result[name]
        return f"{100 * one['share']:.0f} % of {one['of']:.0f}"

    told, swapped = result["exchanged_told"]
    refused, right = result["wrongly_refused"]
    hits, tried = result["exchanges_tried"]
    return "\n".join(
        [
            f"{result['rigs']} rigs; numbers by what is said of them: {result['status']}",
            f"median error as written: {100 * result['written']:.1f} %",
            f"median error of determined numbers: {100 * result['determined']:.1f} %; of ratios to "
            f"the torque per pressure: {100 * result['relative']:.1f} %; of narrowed numbers: "
            f"{100 * result['narrowed']:.1f} %; of angles: {1e3 * result['angles']:.0f} mrad",
            f"90 % intervals hold: {cover('coverage')} of all that are not kept, "
            f"{cover('coverage_determined')} of determined ones, {cover('coverage_relative')} of "
            "ratios",
            f"exchanges told: {told} of {swapped}; refused without one: {refused} of {right}; each "
            f"exchange made on each of the other rigs would be told: {hits} of {tried}",
            f"RMS error of the angle in a free run of a withheld recording, median: "
            f"{1e3 * result['withheld_before']:.0f} mrad as written, "
            f"{1e3 * result['withheld_after']:.1f} mrad calibrated",
            f"processor time of the slowest calibration: {result['seconds']:.0f} s",
            *table_of(result["by_number"]),
        ]
    )


def _one(rig: int, drawn: CalibrationRig, folder: Path) -> tuple[dict[str, Any], list[Compared]]:
    """Calibrate one rig: what was found of it, and its numbers beside the true ones."""
    path = folder / f"{rig:03d}.yaml"
    path.write_text(
        yaml.safe_dump({"/**": {"ros__parameters": dict(drawn.parameters)}}), encoding="utf-8"
    )
    partial = load_partial_rig(path)
    began = time.process_time()
    found = calibrate(drawn, partial)
    seconds = time.process_time() - began
    free_run = [
        one
        for one in found.withheld
        if one.horizon == "free run" and one.channel.endswith("position")
    ]
    what = {
        "rig": rig,
        "exchanged": drawn.exchanged,
        "load_cells": drawn.has_load_cells,
        "refused": bool(found.refused),
        "told": bool(found.wiring),
        "tried": [] if drawn.exchanged else exchanges_told(drawn, partial),
        "why": list(found.refused),
        "before": free_run[0].before if free_run else math.nan,
        "after": free_run[0].after if free_run else math.nan,
        "seconds": seconds,
    }
    rows = [] if drawn.exchanged or found.refused else compare(rig, found.numbers, drawn.truth)
    return what, rows


def of_folder(folder: Path, seed: int) -> tuple[list[dict[str, Any]], list[Compared]]:
    """What was found of all rigs of one seed whose results are in a folder."""
    rigs: list[dict[str, Any]] = []
    rows: list[Compared] = []
    for path in sorted(folder.glob("rig_*.json")):
        one = json.loads(path.read_text(encoding="utf-8"))
        if one["seed"] == seed:
            rigs.append(one["rig"])
            rows += [Compared(**row) for row in one["numbers"]]
    return rigs, rows


def run(given: Arguments) -> Outcome:
    """Draw, calibrate and score; the command of `pam_check.commands.calibration`.

    Each rig has random draws of its own, so that several processes can share a campaign.
    """
    folder = Path(given.out)
    folder.mkdir(parents=True, exist_ok=True)
    for rig in range(given.first, given.first + given.rigs):
        drawn = draw_rig(np.random.default_rng([given.seed, rig]))
        what, compared = _one(rig, drawn, folder)
        state = what["why"][0][:70] if what["refused"] else f"{1e3 * what['after']:.1f} mrad"
        print(
            f"{rig:3d} {what['exchanged'] or '-':20s} {what['seconds']:5.0f} s  {state}", flush=True
        )
        (folder / f"rig_{rig:03d}.json").write_text(
            json.dumps(
                {"seed": given.seed, "rig": what, "numbers": [asdict(one) for one in compared]},
                indent=1,
            ),
            encoding="utf-8",
        )
    rigs, rows = of_folder(folder, given.seed)
    result = score(rows, rigs)
    (folder / "score.json").write_text(
        json.dumps({"seed": given.seed, "score": result}, indent=1), encoding="utf-8"
    )
    print(text_of(result))
    told, swapped = result["exchanged_told"]
    bad = [] if told == swapped else [f"{swapped - told} exchanges were not told"]
    if result["determined"] > GOAL:
        bad.append(f"determined numbers are off by {100 * result['determined']:.1f} % (median)")
    if not LEAST <= result["coverage"]["share"] <= 1.0:
        bad.append(f"90 % intervals hold in {100 * result['coverage']['share']:.0f} % of cases")
    return Outcome({"out": str(folder), **result}, bad)
