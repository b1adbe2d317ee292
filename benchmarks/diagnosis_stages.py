"""Where the time of a diagnosis of 40 s at 500 Hz goes: processor time and simulations by stage.

    python benchmarks/diagnosis_stages.py [--hidden two] [--quick] [--seed S] [--threads N] [--json]

The rig is the first one that `diagnosis_bench.py` draws with this seed. Simulating means the calls
that give the errors of a batch of plants, with the derivation of their constants; the rest of a
stage is the arithmetic of its fits. The time is that of all threads; it depends on the machine and
a little on its other work, the simulations do not. A kernel that is not on disk yet is compiled
meanwhile, and counts: run it twice.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from diagnosis_bench import declare_rigs, draw_cases

from pam_gap.answer.report import write_report
from pam_gap.diagnose_recordings import prepared_subject
from pam_gap.diagnosis_engine import DiagnosisOptions
from pam_gap.diagnosis_files import to_diagnose
from pam_gap.first_look import first_look
from pam_gap.prediction.problem import PredictionProblem
from pam_model.argument_types import count
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command

IMPORTS = "import pam_gap.__main__, pam_gap.diagnosis_files"
IMPORTS_FOR_REPORT = "import pam_gap.answer.report"


@dataclass(slots=True)
class Stage:
    """One stage of a diagnosis.

    Attributes
    ----------
    name : str
        As the progress bar shows it.
    seconds : float
        Processor time of all threads.
    simulating : float
        The part of it that simulates [s].
    simulations : int
        Simulated plants.
    batches : int
        Calls that simulated them side by side.
    """

    name: str
    seconds: float = 0.0
    simulating: float = 0.0
    simulations: int = 0
    batches: int = 0


class StageClock:
    """Books time and simulations to the stage that a diagnosis is at."""

    def __init__(self) -> None:
        self.stages: list[Stage] = []
        self._begun = 0.0

    def enter(self, name: str, _share: float = 0.0) -> None:
        """End the current stage and begin another one; one of the same name goes on."""
        now = time.process_time()
        if self.stages:
            self.stages[-1].seconds += now - self._begun
        self._begun = now
        if not self.stages or self.stages[-1].name != name:
            self.stages.append(Stage(name))

    def simulate(self, errors: Any, problem: Any, values: Any, *options: Any) -> Any:
        """Call the simulation of a batch, and book it."""
        begin = time.process_time()
        try:
            return errors(problem, values, *options)
        finally:
            stage = self.stages[-1]
            stage.simulating += time.process_time() - begin
            stage.simulations += len(values)
            stage.batches += 1


def import_seconds(*, quick: bool) -> float:
    """Processor time of a process that imports what a diagnosis, or a first look, needs [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = IMPORTS if quick else f"{IMPORTS}; {IMPORTS_FOR_REPORT}"
    subprocess.run([sys.executable, "-c", words], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def staged_diagnosis(case: Path, out: Path, threads: int, *, quick: bool) -> list[Stage]:
    """Diagnose a drawn case, or look at it quickly; return the stages, with imports and reading."""
    imports = Stage("start of Python and imports", import_seconds(quick=quick))
    clock = StageClock()
    errors = PredictionProblem.errors

    def simulated(problem: Any, values: Any, *options: Any) -> Any:
        return clock.simulate(errors, problem, values, *options)

    with patch.object(PredictionProblem, "errors", simulated):
        clock.enter("reading the recording")
        rig, read, names = to_diagnose([case / "recording.csv.gz"], case / "rig.yaml", None, {})
        engine = prepared_subject(rig, names[0], read, DiagnosisOptions(threads, clock.enter))
        if quick:
            first_look(engine)
        else:
            diagnosis = engine.run()
            clock.enter("report")
            write_report(out / "report.html", engine.problem, diagnosis, "")
        clock.enter("done")
    return [imports, *(stage for stage in clock.stages if stage.name != "done")]


def _declare(parser: Parser) -> None:
    declare_rigs(parser, hidden="one")
    parser.add_argument(
        "--threads", type=count(0), default=0,
        help="simulations at once (default: 0, one per processor)",
    )  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="the first look alone")


def _run(chosen: Arguments) -> Outcome:
    """Measure and print a table."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        name, label, samples = next(
            draw_cases(chosen.hidden, chosen.seed, place / "cases", place / "sealed")
        )
        stages = staged_diagnosis(place / "cases" / name, place, chosen.threads, quick=chosen.quick)
    total = Stage("all")
    for stage in stages:
        total.seconds += stage.seconds
        total.simulating += stage.simulating
        total.simulations += stage.simulations
        total.batches += stage.batches
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"hidden: {' + '.join(label.effects)}; {samples} samples; {most:.0f} MiB at most")
    print(f"{'stage':36s} seconds   of it simulating   simulations   batches")
    for stage in (*stages, total):
        print(f"{stage.name[:36]:36s} {stage.seconds:7.2f}   {stage.simulating:16.2f}"
              f"   {stage.simulations:11d}   {stage.batches:7d}")  # fmt: skip
    return Outcome([asdict(stage) for stage in stages])


BENCH = Command("stages", "processor time and simulations by stage of a diagnosis", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/diagnosis_stages.py"))
