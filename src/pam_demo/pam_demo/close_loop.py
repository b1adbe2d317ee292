"""`pam demo close-loop`: diagnose a hidden effect and compare tracking before and after.

The demo runs on a simulated rig with an effect that its rig file does not contain. The recording is
diagnosed. Then the demo runs again on the same simulated rig, and every node uses the improved rig
file. The page shows the tracking error of both runs, measured by the sensor and taken from the
plant itself. With several runs on each side, the errors are medians; the first run is diagnosed and
plotted.

Only the simulated rig knows the hidden effect. The diagnosis gets the rig file of the first run and
its recording without the ground truth.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import median

from pam_demo.close_loop_page import write_page
from pam_demo.programs import DEMO
from pam_demo.tracking import ClosedLoopFigure, TrackedMotion, tracked_motions
from pam_gap.diagnosis_files import IMPROVED_RIG, diagnose_files
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import load_rig
from pam_sim.rig import parse_effects
from pam_sim.simulated_rig import apply_effects

RESULTS = "close_loop.json"
RUNS = "runs.json"
ATTEMPTS = 3
DEMO_TIMEOUT = 600.0  # s


def run_demo(
    out: Path,
    rig: Path,
    effects: Sequence[str],
    *,
    true_rig: Path | None = None,
    can: str = "",
    rate: float | None = None,
) -> Path:
    """Run the short demo as a separate process and return its folder.

    Parameters
    ----------
    out : Path
        Folder for its recording and log.
    rig : Path
        Rig file of driver, model and controller.
    effects : sequence of str
        Hidden effects of the plant, `effect.parameter=value`.
    true_rig : Path, optional
        Rig file of the plant, to which `effects` are added; default `rig`.
    can : str, optional
        CAN interface; by default the demo chooses one.
    rate : float, optional
        Of the loops [Hz]; by default the demo finds one that this computer holds.

    Raises
    ------
    PamError
        When it fails `ATTEMPTS` times; the message has its last lines of output.
    """
    command = [sys.executable, "-m", DEMO, "--short", "--rig", str(rig)]
    command += ["--out", str(out), "--true-effects", *effects]
    if true_rig is not None:
        command += ["--true-rig", str(true_rig)]
    if can:
        command += ["--can", can]
    if rate is not None:
        command += ["--rate", f"{rate:g}"]
    out.mkdir(parents=True, exist_ok=True)
    output = ""
    for attempt in range(1, ATTEMPTS + 1):
        try:
            ended = subprocess.run(
                command, capture_output=True, text=True, timeout=DEMO_TIMEOUT, check=False
            )
        except subprocess.TimeoutExpired:
            output = f"not finished after {DEMO_TIMEOUT:g} s"
            continue
        output = (ended.stdout + ended.stderr).strip()
        (out / "demo.log").write_text(output)
        if ended.returncode == 0:
            return out
        print(f"demo, attempt {attempt} of {ATTEMPTS}: {output.splitlines()[-1:]}", file=sys.stderr)
    last = " ".join(output.splitlines()[-3:])
    raise PamError(f"{out}: the demo failed {ATTEMPTS} times: {last}")


def rate_of(folder: Path) -> float:
    """At which rate the loops ran in a run of the demo [Hz]."""
    return float(json.loads((folder / RUNS).read_text(encoding="utf-8"))[0]["rate"])


def run_demos(
    out: Path,
    runs: int,
    rig: Path,
    effects: Sequence[str],
    *,
    true_rig: Path | None = None,
    can: str = "",
    rate: float | None = None,
) -> list[list[TrackedMotion]]:
    """Run the demo several times, into `out`, `out`_2 and so on; return each run's motions.

    Parameters and errors are those of `run_demo`. All runs have the rate of the first.
    """
    folders = [
        out if run == 1 else out.with_name(f"{out.name}_{run}") for run in range(1, runs + 1)
    ]
    for folder in folders:
        run_demo(folder, rig, effects, true_rig=true_rig, can=can, rate=rate)
        rate = rate_of(folder)
    joint = load_rig(rig).joint_names[0]
    return [tracked_motions(folder, joint) for folder in folders]


def compared(
    before: Sequence[Sequence[TrackedMotion]], after: Sequence[Sequence[TrackedMotion]]
) -> list[ClosedLoopFigure]:
    """Medians over the runs of the errors of each motion; empty without runs after."""
    if not after:
        return []
    return [
        ClosedLoopFigure(
            ones[0].measured.motion.name,
            median(one.measured.rms() for one in ones),
            median(two.measured.rms() for two in twos),
            median(one.true.rms() for one in ones),
            median(two.true.rms() for two in twos),
        )
        for ones, twos in zip(zip(*before, strict=True), zip(*after, strict=True), strict=True)
    ]


def close_loop(
    rig: Path, effects: Sequence[str], out: Path, *, can: str = "", runs: int = 1
) -> Path:
    """Run demo, diagnosis and second demo, write the page and return its path.

    Parameters
    ----------
    rig : Path
        Rig file; the demo moves its first joint.
    effects : sequence of str
        Hidden effects of the simulated rig, `effect.parameter=value`.
    out : Path
        Folder for all results.
    can : str, optional
        CAN interface of all runs.
    runs : int, optional
        Runs before and after the diagnosis of the first one.

    Raises
    ------
    PamError
        For a rig file or an effect that cannot be used, or a demo that fails.
    """
    written = load_rig(rig)
    apply_effects(written, written, parse_effects(effects, "--hide"))
    rig = rig.resolve()
    print(f"1/4 run the demo with the hidden effects {', '.join(effects)}")
    before = run_demos(out / "before", runs, rig, effects, can=can)
    print("2/4 diagnose its recording")
    joint = written.joint_names[0]
    (diagnosis,) = diagnose_files([out / "before" / "bag"], rig, out / "diagnosis", joint=joint)
    print(f"    {diagnosis.sentence}")
    improved = out / "diagnosis" / IMPROVED_RIG
    after: list[list[TrackedMotion]] = []
    if diagnosis.improved is not None:
        print("3/4 run the demo on the same rig with the improved rig file")
        after = run_demos(
            out / "after", runs, improved.resolve(), effects, true_rig=rig, can=can,
            rate=rate_of(out / "before"),
        )  # fmt: skip
    else:
        print("3/4 there is no improved rig file, so there is no second run")
    print("4/4 write the page")
    figures = compared(before, after)
    (out / RESULTS).write_text(
        json.dumps(
            {
                "hidden": list(effects),
                "diagnosis": diagnosis.to_json(),
                "tracking": [asdict(figure) for figure in figures],
                "unit": "rad",
                "runs": {
                    side: [
                        {each.true.motion.name: each.true.rms() for each in run} for run in played
                    ]
                    for side, played in (("before", before), ("after", after))
                },
            },
            indent=1,
        )
    )
    page = out / "close_loop.html"
    first = [motion.measured for motion in before[0]]
    second = [motion.measured for motion in after[0]] if after else []
    write_page(page, effects, diagnosis, first, second, figures, runs)
    error = "RMS error" if runs == 1 else f"median RMS error of {runs} runs"
    for figure in figures:
        print(
            f"{figure.motion}: {error} {1e3 * figure.before:.2f} -> {1e3 * figure.after:.2f} mrad "
            f"measured, {1e3 * figure.true_before:.2f} -> {1e3 * figure.true_after:.2f} true"
        )
    print(f"written: {page}")
    return page


def run(given: Arguments) -> Outcome:
    """Run `close_loop` for the command line (`pam_demo.__main__`)."""
    page = close_loop(chosen_rig(given), given.hide, given.out, can=given.can, runs=given.runs)
    document = json.loads((given.out / RESULTS).read_text(encoding="utf-8"))
    worse = [
        f"{figure['motion']}: RMS error {1e3 * figure['before']:.2f} mrad before, "
        f"{1e3 * figure['after']:.2f} mrad after"
        for figure in document["tracking"]
        if figure["after"] >= figure["before"]
    ]
    if not document["tracking"]:
        worse = ["the diagnosis has written no improved rig file"]
    return Outcome({**document, "page": page}, worse)
