"""After a campaign: run the experiments of ambiguous diagnoses, and diagnose both recordings.

The hidden rig is simulated in a separate process (`pam_check.blind.carry_out`), which returns a
recording. The second diagnosis gets the first recording, the new one and the mounting of the joint.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pam_check.blind.plants import FIRST
from pam_check.blind.score import reported_set, share
from pam_check.programs import CARRY_OUT_EXPERIMENT, DIAGNOSIS
from pam_gap.experiments.files import DETAILS, FOLDER
from pam_gap.recordings.recording import LOCKED, TURNED_OVER
from pam_model.errors import PamError

HOW_MOUNTED = {"": [], TURNED_OVER: ["--turned-over"], LOCKED: ["--locked"]}


def ambiguity(answer: Mapping[str, Any]) -> int:
    """Number of explanations that the answer leaves open; 1 if it names an effect."""
    return max((len(group) for group in answer["indistinguishable"]), default=1)


def experiment_on_case(campaign: Path, case: str, plant: str = FIRST) -> dict[str, Any]:
    """Run the proposed experiment of one case and diagnose again.

    Raises
    ------
    PamError
        When the hidden rig cannot be simulated.
    """
    proposal = campaign / "answers" / case / FOLDER
    place = campaign / "experiments" / case
    recording = place / "recording.csv.gz"
    environment = os.environ | {"NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", CARRY_OUT_EXPERIMENT, "--sealed", str(campaign / "sealed"),
         "--case", case, "--experiment", str(proposal), "--out", str(recording),
         "--plant", plant],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    if done.returncode != 0:
        raise PamError(f"case {case}: {(done.stderr.strip().splitlines() or ['failed'])[-1]}")
    details = json.loads((proposal / DETAILS).read_text())
    done = subprocess.run(
        [sys.executable, "-m", DIAGNOSIS, "diagnose",
         str(campaign / "cases" / case / "recording.csv.gz"),
         *([str(recording)] if not details["mounting"] else []),
         "--rig", str(campaign / "cases" / case / "rig.yaml"), "--out", str(place),
         "--no-progress", *HOW_MOUNTED[details["mounting"]],
         *([str(recording)] if details["mounting"] else [])],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    before = json.loads((campaign / "answers" / case / "diagnosis.json").read_text())
    result = {
        "case": case,
        "experiment": details["name"],
        "before": sorted(reported_set(before)),
        "ambiguity_before": ambiguity(before),
    }
    if done.returncode != 0:
        return result | {"verdict": "crash", "halved": False, "error": done.stderr[-500:]}
    after = json.loads((place / "diagnosis.json").read_text())
    left = ambiguity(after)
    gone = result["ambiguity_before"] - left
    # One explanation with more effects in place of two simple ones is not a smaller set.
    fewer = len(reported_set(after)) <= len(reported_set(before)) - gone
    decided = after["verdict"] in ("named", "ambiguous") and fewer
    return result | {
        "verdict": after["verdict"],
        "after": sorted(reported_set(after)),
        "ambiguity_after": left,
        "halved": decided and 2 * left <= result["ambiguity_before"],
    }


def run_experiments(
    campaign: Path,
    labels: list[dict[str, Any]],
    answers: Mapping[str, Mapping[str, Any]],
    workers: int,
    plant: str = FIRST,
) -> dict[str, Any]:
    """Run the proposed experiments of all ambiguous cases of a scored campaign.

    Parameters
    ----------
    campaign : Path
        Folder of the campaign.
    labels : list of dict
        The opened labels, which show whether the true effect stayed in the set.
    answers : mapping
        Answers of the campaign.
    workers : int
        Number of parallel processes.
    plant : str
        Plant that made the recordings of the campaign.

    Returns
    -------
    dict
        `halved`: share of ambiguous cases whose set became at most half as large; `truth_kept`:
        share of the cases with the true effect in the set before that still have it; `cases`: the
        details of each case.
    """  # fmt: skip
    names = [
        name
        for name in sorted(answers)
        if answers[name]["verdict"] == "ambiguous"
        and (campaign / "answers" / name / FOLDER / DETAILS).exists()
    ]
    with ThreadPoolExecutor(workers) as pool:
        results = list(pool.map(lambda name: experiment_on_case(campaign, name, plant), names))
    truth = {str(label["case"]): set(label["effects"]) for label in labels}
    kept = [
        truth[r["case"]] <= set(r.get("after", ()))
        for r in results
        if truth[r["case"]] and truth[r["case"]] <= set(r["before"])
    ]
    return {
        "halved": share([bool(r["halved"]) for r in results]).to_json(),
        "truth_kept": share(kept).to_json(),
        "cases": [r | {"truth": sorted(truth[r["case"]])} for r in results],
    }
