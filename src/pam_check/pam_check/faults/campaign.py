"""Injects every fault many times and holds what follows against what docs/safety.md promises.

`python -m pam_check faults --trials 600 --out out/faults` runs boards, plant, bus, driver, model
and controller in one process on a virtual clock; each trial is a fork of one chain in motion, so
that each meets it in another phase.
"""

from __future__ import annotations

import os
import pickle
import random
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from pam_check.faults.chain import FaultChain
from pam_check.faults.report import as_markdown, write_report
from pam_check.faults.trial import Trial, draw_values, run_trial
from pam_control.controller_parameters import create_controller, parameter_table
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, chosen_rig, progress
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_sim.faults.kinds import KINDS, FaultKind, kinds_called

TRIALS_OF_EACH = 8  # kinds, where nothing else is asked for
LONGEST_PHASE = 0.4  # s, between two trials; the motion's period is 1.7 s


def make_chain(rig: Rig, seed: int = 0) -> FaultChain:
    """A chain of this rig, in motion.

    Raises
    ------
    PamError
        If it does not come up.
    """
    names = rig.joint_names
    values = {entry.name: entry.default for entry in parameter_table(names)}
    chain = FaultChain(rig, create_controller(rig, values, names), seed)
    chain.start()
    return chain


def in_a_fork(work: Callable[[], Trial]) -> Trial:
    """Do something in a copy of this process, so that nothing of it remains here.

    Raises
    ------
    PamError
        If the copy ends without a result.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.close(reading)
            with os.fdopen(writing, "wb") as out:
                pickle.dump(work(), out)
            code = 0
        except Exception as error:
            print(f"fault campaign: {type(error).__name__}: {error}", file=sys.stderr)
        finally:
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading, "rb") as result:
        data = result.read()
    os.waitpid(child, 0)
    if not data:
        raise PamError("a trial ended without a result")
    trial: Trial = pickle.loads(data)  # what our own copy has written
    return trial


def run_campaign(rig: Rig, kinds: Sequence[FaultKind], trials: int, seed: int) -> Iterator[Trial]:
    """Trials of all kinds in turn.

    Parameters
    ----------
    rig : Rig
        What is simulated.
    kinds : sequence of FaultKind
        What is injected.
    trials : int
        How many in all.
    seed : int
        Of everything drawn.
    """
    chain = make_chain(rig, seed)
    draw = random.Random(seed)
    for number in range(trials):
        kind = kinds[number % len(kinds)]
        until = chain.now + draw.uniform(0.0, LONGEST_PHASE)
        while chain.now < until:
            chain.step()
        values, trial_seed = draw_values(kind, draw), draw.randrange(1 << 30)
        yield in_a_fork(partial(run_trial, chain, kind, values, trial_seed))


def run(given: Arguments) -> Outcome:
    """Inject, print and write the report; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig or a fault that cannot be used.
    """
    kinds = kinds_called(given.kind, KINDS)
    trials = given.trials or TRIALS_OF_EACH * len(kinds)
    done: list[Trial] = []
    with progress(trials, "fault campaign") as bar:
        for trial in run_campaign(load_rig(chosen_rig(given)), kinds, trials, given.seed):
            done.append(trial)
            bar.show(len(done), trial.kind)
            if trial.problem:
                print(f"{trial.kind} {trial.values}: {trial.problem}", file=sys.stderr)
    bad = [trial for trial in done if trial.problem]
    page = write_report(kinds, done, given.out)
    if given.page:
        text = as_markdown(kinds, done, _command_line(given))
        make_parents(given.page).write_text(text, encoding="utf-8")
    print(f"{len(done)} injections of {len(kinds)} kinds, {len(bad)} out of bounds: {page}")
    return Outcome(
        {"kinds": len(kinds), "out_of_bounds": len(bad), "trials": done, "page": page},
        [f"{trial.kind}: {trial.problem}" for trial in bad],
    )


def _command_line(given: Arguments) -> str:
    """What makes the same table again; for the page that shows it."""
    words = ["python -m pam_check faults"]
    words += [] if given.rig is None else [f"--rig {given.rig}"]
    words += [] if given.trials is None else [f"--trials {given.trials}"]
    words += [f"--kind {name}" for name in given.kind or ()]
    return " ".join([*words, f"--seed {given.seed}", f"--page {given.page}"])
