"""Diagnoses case after case in a process that gets only recordings and rig files.

Run as `python -m pam_check.blind.diagnosing_process`. The process reads one case per line from
standard input and answers with one line each. It stays for all cases of a worker, because a start
takes longer than a tenth of a diagnosis: Python's modules and the compiled simulation are read.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import json
import os
import subprocess
import sys
import tempfile
import time
import traceback
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, Self

from pam_check.programs import DIAGNOSE_CASES
from pam_gap.diagnosis_files import diagnose_files
from pam_model.linear_algebra_threads import ONE_THREAD

STDERR_SHOWN = 2000  # characters


class DiagnosingProcess:
    """A process that diagnoses one case at a time; a context manager that ends it.

    It is started with the first case, and again after a case that ended it.

    Parameters
    ----------
    threads : int
        Number of simulations that it runs in parallel; others diagnose at the same time.
    keep_evidence : bool
        Whether it keeps the evidence that `sensitivity` needs.
    experiment : bool
        Whether it seeks the next experiment and writes a report page.
    """

    def __init__(
        self, threads: int = 1, *, keep_evidence: bool = False, experiment: bool = False
    ) -> None:
        self._options = {"threads": threads, "keep_evidence": keep_evidence,
                         "answer_only": not experiment}  # fmt: skip
        self._environment = os.environ | ONE_THREAD
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  (closed in __exit__)
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.end()
        self._errors.close()

    def end(self) -> None:
        """Kill the process, also while another thread waits for its answer."""
        process = self._process
        if process is not None:
            process.kill()
            with process:  # waits for its end, and closes the pipes
                pass

    def task(self, case: Path, out: Path) -> dict[str, Any]:
        """What the process is told about a case."""
        return {"case": str(case), "out": str(out), **self._options}

    def diagnose(self, case: Path, out: Path) -> dict[str, Any]:
        """Diagnose the case in a folder; the answer has the verdict `crash` where this fails."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", DIAGNOSE_CASES], env=self._environment, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
            )  # fmt: skip
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        started = time.monotonic()
        line = ""
        try:
            self._process.stdin.write(json.dumps(self.task(case, out)) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            pass  # it has ended before it could read
        error = json.loads(line)["error"] if line else self._last_words()
        result = out / "diagnosis.json"
        answer: dict[str, Any] = (
            {"verdict": "crash", "effects": [], "indistinguishable": [], "stage": None,
             "candidates": [], "error": error}
            if error or not result.exists()
            else json.loads(result.read_text())
        )  # fmt: skip
        return answer | {"wall_time": time.monotonic() - started}

    def _last_words(self) -> str:
        """What a process that has ended wrote to standard error."""
        assert self._process is not None
        with self._process as ended:
            code = ended.wait()
        self._process = None
        self._errors.seek(0)
        return f"ended with exit code {code}\n{self._errors.read()[-STDERR_SHOWN:]}"


def _diagnose(task: dict[str, Any]) -> str:
    """Diagnose a case; return the error, if there is one."""
    case = Path(task["case"])
    try:
        diagnose_files(
            [case / "recording.csv.gz"],
            case / "rig.yaml",
            Path(task["out"]),
            threads=task["threads"],
            show_progress=False,
            keep_evidence=task["keep_evidence"],
            answer_only=task["answer_only"],
        )
    except Exception:  # the campaign goes on with the next case, and counts this one
        return traceback.format_exc()[-STDERR_SHOWN:]
    return ""


def main() -> int:
    """Diagnose the cases that standard input names, until it ends."""
    answers = sys.stdout
    with redirect_stdout(sys.stderr):
        for line in sys.stdin:
            answers.write(json.dumps({"error": _diagnose(json.loads(line))}) + "\n")
            answers.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
