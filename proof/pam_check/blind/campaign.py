"""`pam check blind`: draw hidden effects, diagnose the recordings, open labels, score.

The cases are drawn in a separate process (`pam_check.blind.cases`). The diagnoses run in processes
that get only recordings and rig files (`pam_check.blind.diagnosing_process`). The digest of the
labels is stored before the first diagnosis and compared when the labels are opened.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import matplotlib as mpl
import numpy as np

from pam_check.blind.cases import LABELS
from pam_check.blind.diagnosing_process import DiagnosingProcess
from pam_check.blind.experiments import run_experiments
from pam_check.blind.parameter_coverage import as_json, by_parameter, stated_parameters
from pam_check.blind.plants import FIRST
from pam_check.blind.score import score, share
from pam_check.blind.score_plots import draw_confusion, draw_reliability
from pam_check.blind.untouched import with_untouched
from pam_check.programs import DRAW_CASES
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.errors import PamError

SEAL = "seal.json"


@dataclass(frozen=True, slots=True)
class DrawnFrom:
    """What the rigs of a campaign were drawn from."""

    cases: int
    seed: int
    background: bool
    plant: str = FIRST
    varied: bool = False

    def seal(self, out: Path, digest: str) -> None:
        """Write down the digest of the labels before the first diagnosis."""
        text = json.dumps({"drawn": asdict(self), "labels_sha256": digest}, indent=1)
        (out / SEAL).write_text(text + "\n")

    def sealed_in(self, out: Path) -> str:
        """Digest of the labels of the campaign that `out` holds.

        Raises
        ------
        PamError
            When `out` holds none, or one that was drawn from something else.
        """
        if not (out / SEAL).exists():
            raise PamError(f"{out}: no campaign to resume; expected {SEAL}, which --out writes")
        found = json.loads((out / SEAL).read_text())
        if {"plant": FIRST, "varied": False} | found["drawn"] != asdict(self):
            raise PamError(
                f"{out}: holds a campaign of {found['drawn']}; give the same --cases, --seed, "
                "--background, --varied and --plant to resume it"
            )
        return str(found["labels_sha256"])


def draw_sealed(drawn: DrawnFrom, out: Path) -> str:
    """Draw the cases in another process; return the digest of the sealed labels.

    Raises
    ------
    PamError
        When the generator fails.
    """
    done = subprocess.run(
        [sys.executable, "-m", DRAW_CASES, "--cases", str(drawn.cases), "--seed", str(drawn.seed),
         "--folder", str(out / "cases"), "--sealed", str(out / "sealed"),
         "--plant", drawn.plant, *(["--background"] if drawn.background else []),
         *(["--varied"] if drawn.varied else [])],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode != 0:
        raise PamError(f"drawing the cases failed: {done.stderr.strip().splitlines()[-1]}")
    return done.stdout.strip()


def finished_answers(out: Path) -> dict[str, dict[str, Any]]:
    """Answers of the cases of a campaign that have been diagnosed."""
    answers = {}
    for path in sorted((out / "answers").glob("*/diagnosis.json")):
        answer: dict[str, Any] = json.loads(path.read_text())
        answer["wall_time"] = float(answer["facts"].get("seconds", 0.0))
        answers[path.parent.name] = answer
    return answers


def diagnose_all(
    names: Sequence[str],
    out: Path,
    workers: int,
    *,
    keep_evidence: bool = False,
    experiment: bool = False,
) -> dict[str, dict[str, Any]]:
    """Diagnose the cases of a campaign with these names, in processes that see no label."""
    threads = max(1, (os.cpu_count() or 1) // workers)
    free: SimpleQueue[DiagnosingProcess] = SimpleQueue()

    def diagnose(name: str) -> dict[str, Any]:
        process = free.get()
        try:
            return process.diagnose(out / "cases" / name, out / "answers" / name)
        finally:
            free.put(process)

    answers = {}
    with ThreadPoolExecutor(workers) as pool, ExitStack() as processes:
        for _ in range(workers):
            process = DiagnosingProcess(threads, keep_evidence=keep_evidence, experiment=experiment)
            free.put(processes.enter_context(process))
        runs = {pool.submit(diagnose, name): name for name in names}
        try:
            with progress(len(runs), "diagnosing") as bar:
                for number, done in enumerate(as_completed(runs), 1):
                    answers[runs[done]] = done.result()
                    bar.show(number)
        except BaseException:  # such as Ctrl-C: what waits is not begun
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return answers


def open_labels(sealed: Path, digest: str) -> list[dict[str, Any]]:
    """Open the labels and check that they are the sealed ones.

    Raises
    ------
    PamError
        When their digest differs from the stored one.
    """
    text = (sealed / LABELS).read_text()
    if hashlib.sha256(text.encode()).hexdigest() != digest:
        raise PamError(
            f"{sealed / LABELS}: these are not the labels that were sealed before the diagnosis"
        )
    labels: list[dict[str, Any]] = json.loads(text)
    return labels


def add_untouched(out: Path, answers: dict[str, dict[str, Any]]) -> None:
    """Add to each answer how much its improved rig closes the gap on the second recording."""
    for name, answer in answers.items():
        answers[name] = with_untouched(answer, out, name, out / "answers" / name)


def run_campaign(
    cases: int,
    seed: int,
    out: Path,
    workers: int,
    experiments: bool = False,
    keep_evidence: bool = False,
    background: bool = False,
    resume: bool = False,
    plant: str = FIRST,
    varied: bool = False,
) -> dict[str, Any]:
    """Draw, diagnose and score `cases` cases; all files are written into `out`.

    With `experiments`, the experiment that each ambiguous diagnosis proposes is run and scored as
    well. With `keep_evidence`, every diagnosis keeps the evidence that `sensitivity` needs.
    With `background`, every rig has an ordinary background besides its hidden effects.
    With `varied`, rigs with a background are of many sizes and kinds.
    With `plant`, another plant of `plants.PLANTS` makes the recordings.
    With `resume`, a campaign that was interrupted goes on: cases with an answer keep it.

    Raises
    ------
    PamError
        When `out` already contains a campaign (with `resume`: another or none), or the generator
        fails.
    """
    drawn = DrawnFrom(cases, seed, background or varied, plant, varied)
    if resume:
        digest = drawn.sealed_in(out)
    elif (out / "cases").exists():
        raise PamError(f"{out}: holds a campaign already; give another --out, or --resume")
    else:
        out.mkdir(parents=True, exist_ok=True)
        digest = draw_sealed(drawn, out)
        drawn.seal(out, digest)
    answers = finished_answers(out)
    names = sorted(p.name for p in (out / "cases").iterdir() if p.name not in answers)
    answers |= diagnose_all(
        names, out, workers, keep_evidence=keep_evidence, experiment=experiments
    )
    labels = open_labels(out / "sealed", digest)
    add_untouched(out, answers)
    result = score(labels, answers)
    parameters = stated_parameters(labels, answers, out / "cases", plant)
    result["parameters"] = as_json(parameters)
    result["parameters_covered"] = by_parameter(parameters)
    covered = share([one.is_covered for one in parameters if one.counts])
    result["shares"]["parameter_interval_covers"] = covered.to_json()
    if experiments:
        result["experiments"] = run_experiments(out, labels, answers, workers, plant)
    result |= {
        "cases": cases,
        "seed": seed,
        "plant": plant,
        "labels_sha256": digest,
        "untouched": {
            name: answer["closed"]["untouched"]
            for name, answer in sorted(answers.items())
            if answer.get("closed") and "untouched" in answer["closed"]
        },
        "crashed": sum(answer["verdict"] == "crash" for answer in answers.values()),
        "wall_time_median": float(np.median([a["wall_time"] for a in answers.values()])),
        "wall_time_worst": float(max(a["wall_time"] for a in answers.values())),
    }
    (out / "score.json").write_text(json.dumps(result, indent=1))
    draw_confusion(result["confusion"], out / "confusion.png")
    draw_reliability(result, out / "reliability.png")
    return result


def run(given: Arguments) -> Outcome:
    """Run the campaign and print its scores; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        When the folder already contains a campaign, or the generator fails.
    """
    mpl.use("Agg")
    seed = given.seed if given.seed is not None else time.time_ns() % 2**32
    result = run_campaign(
        given.cases, seed, given.out, given.workers, given.experiments, given.keep_evidence,
        given.background, given.resume, given.plant, given.varied,
    )  # fmt: skip
    print(f"seed {seed}; labels sealed as {result['labels_sha256'][:16]}…")
    shares = dict(result["shares"])
    if "experiments" in result:
        shares["set_halved"] = result["experiments"]["halved"]
        shares["truth_kept"] = result["experiments"]["truth_kept"]
    for name, entry in shares.items():
        low, high = entry["interval"]
        if entry["of"]:
            print(
                f"{name:24s} {entry['value']:6.1%}  ({entry['hits']}/{entry['of']}; "
                f"90 % interval {low:.0%} to {high:.0%})"
            )
    for name, entry in result["parameters_covered"].items():
        remark = "" if entry["counts"] else " (not counted: the laws differ)"
        print(f"interval of {name:36s} holds the true value {entry['hits']}/{entry['of']}{remark}")
    for of, key in (("stated", "reliability"), ("a cause", "reliability_of_causes")):
        for entry in result[key]:
            right = entry["right"]
            if right["of"]:
                print(
                    f"{of:8s}{entry['from']:.2f} to {entry['to']:.2f}     {right['value']:6.1%} "
                    f"right ({right['hits']}/{right['of']}; mean {entry['stated_mean']:.2f})"
                )
    if result["closed_median"] is not None:
        print(f"{'gap closed, median':24s} {result['closed_median']:6.1%}")
    if result["untouched_median"] is not None:
        print(f"{'same, second motion':24s} {result['untouched_median']:6.1%}")
    print(
        f"{'time per case':24s} {result['wall_time_median']:5.1f} s median, "
        f"{result['wall_time_worst']:.1f} s worst"
    )
    print(f"written: {given.out}: score.json, confusion.png, reliability.png")
    crashed = result["crashed"]
    return Outcome(result, [f"{crashed} diagnoses crashed"] if crashed else ())
