"""A robot over weeks: one effect grows from some week on, another is repaired, one file is corrupt.

The truth plant of the blind check is recorded at even intervals of time, each time with another
motion and other noise. `pam gap fleet` then sees the folder and nothing else, and the
changes that it reports are compared with the true dates.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from pam_check.blind.cases import rig_parameters, to_table
from pam_check.blind.draw import Draw, believed_rig, draw_excitation, draw_sensors, perturbed
from pam_check.blind.truth_plant import TruthRecording, run_truth
from pam_gap.fleet.fleet import Settings, analyse_fleet
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError
from pam_model.rig import rig_from_parameters, save_rig

START = datetime(2026, 1, 5, 9, 0, tzinfo=UTC).timestamp()
WEEK = 7 * 86400.0
SAMPLE_TIME = 0.004
TOLERANCE = 0.01
LEAST_TRAVEL = 0.15  # rad
MAX_TRIES = 40
DRIFTING, REPAIRED = "coulomb_friction", "leakage"
FRICTION, GROWTH = 0.25, 0.12  # N m at the beginning, N m a week
LEAK = 1.2e-10  # m^3/(s Pa)
CORRUPT = "corrupt.csv.gz"


@dataclass(frozen=True)
class Story:
    """What happens to the robot."""

    drift_from: float  # unix time from which its friction grows [s]
    repaired_at: float  # unix time at which its leak is closed [s]

    def friction(self, at: float) -> float:
        """Dry friction [N m] at a Unix time."""
        return FRICTION + GROWTH * max(0.0, at - self.drift_from) / WEEK

    def leak(self, at: float) -> float:
        """Conductance of the leak [m^3/(s Pa)] at a Unix time."""
        return LEAK if at < self.repaired_at else 0.0


def make_fleet(
    folder: Path, recordings: int, weeks: float, duration: float, seed: int
) -> tuple[Story, list[float]]:
    """Write rig.yaml and the folder `recordings`; return the story and the times of recording.

    Raises
    ------
    PamError
        When no motion of the drawn rig is usable.
    """
    random = np.random.default_rng(seed)
    joint, muscle = believed_rig(random)
    draw = Draw(random, joint, [muscle, muscle])
    perturbed(draw, TOLERANCE)
    sensors = draw_sensors(random)
    times = START + np.linspace(0.0, weeks, recordings) * WEEK
    story = Story(START + 0.35 * weeks * WEEK, START + 0.62 * weeks * WEEK)
    place = folder / "recordings"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for number, at in enumerate(times.tolist()):
        friction = story.friction(at)
        true_joint = draw.joint._replace(coulomb_torque=friction, static_torque=friction)
        muscles = tuple(m._replace(leak=story.leak(at)) for m in draw.muscles)

        def attempt(joint: Any = true_joint, muscles: Any = muscles) -> TruthRecording | None:
            motion = draw_excitation(random, joint, SAMPLE_TIME, duration)
            try:
                made = run_truth(joint, muscles, motion, sensors, random)
            except FloatingPointError:
                return None
            return made if np.ptp(made.true_position) >= LEAST_TRAVEL else None

        recording = next((r for r in (attempt() for _ in range(MAX_TRIES)) if r is not None), None)
        if recording is None:
            raise PamError(f"seed {seed}: the drawn rig does not move; try another seed")
        table = to_table(recording, load_cells=False)
        table["time"] += at
        table.to_parquet(place / f"{number:03d}.parquet", index=False)
    (place / CORRUPT).write_bytes(b"this is no recording")
    save_rig(rig_from_parameters(rig_parameters(joint, muscle, TOLERANCE)), folder / "rig.yaml")
    return story, times.tolist()


def score(document: Mapping[str, Any], story: Story, times: Sequence[float]) -> dict[str, Any]:
    """Compare the reported changes with what happened; a date counts within one week."""
    changes = [c for series in document["series"] for c in series["changes"]]

    def nearest(effect: str, kinds: Sequence[str], truth: float) -> float | None:
        """Distance in weeks of the nearest reported change of an effect to the true date."""
        found = [
            abs(c["time"] - truth) / WEEK
            for c in changes
            if c["effect"] == effect and c["kind"] in kinds
        ]
        return min(found, default=None)

    expected = {(DRIFTING, "slope"), (REPAIRED, "step")}
    drift = nearest(DRIFTING, ("slope",), story.drift_from)
    repair = nearest(REPAIRED, ("step",), story.repaired_at)
    rates = [
        c["rate_per_week"] for c in changes if c["effect"] == DRIFTING and c["kind"] == "slope"
    ]
    failed = [r["recording"] for r in document["recordings"] if r["failure"]]
    return {
        "drift": {"weeks_off": drift, "found": drift is not None and drift <= 1.0},
        "drift_rate": {"found": rates, "true": GROWTH},
        "repair": {"weeks_off": repair, "found": repair is not None and repair <= 1.0},
        "other_changes": sum((c["effect"], c["kind"]) not in expected for c in changes),
        "failed": failed,
        "corrupt_is_a_row": failed == [CORRUPT],
        "rows": len(document["recordings"]),
        "recordings": len(times),
        "story": asdict(story),
    }


def run(given: Arguments) -> Outcome:
    """Draw a fleet, diagnose it and score the changes found; the command `fleet`."""
    folder = Path(given.out)
    story, times = make_fleet(folder, given.recordings, given.weeks, given.duration, given.seed)
    started, used = time.monotonic(), os.times()
    document = analyse_fleet(
        Settings(
            folder / "recordings",
            folder / "answer",
            rig=folder / "rig.yaml",
            workers=given.workers,
            full_every=given.full_every,
        )
    )
    now = os.times()
    result = score(document, story, times)
    result["seconds"] = time.monotonic() - started
    result["processor_seconds"] = sum(now[:4]) - sum(used[:4])
    for name in ("drift", "repair"):
        entry = result[name]
        off = entry["weeks_off"]
        words = "not found" if off is None else f"found {off:.2f} weeks from the true date"
        print(f"{name}: {words}")
    print(
        f"{result['rows']} recordings in {result['seconds']:.0f} s on {given.workers} workers; "
        f"failed: {', '.join(result['failed']) or 'none'}; other changes: {result['other_changes']}"
    )
    print(f"written: {folder}")
    bad = [f"{name} was not found at the right week" for name in ("drift", "repair")
           if not result[name]["found"]]  # fmt: skip
    if not result["corrupt_is_a_row"]:
        bad.append("the corrupt recording is not the only failed row")
    return Outcome(result, bad)
