"""Injects every fault many times and holds what follows against what docs/safety.md promises.

`python -m pam_check.faults.campaign --trials 600 --out out/faults` runs boards, plant, bus, driver,
model and controller in one process on a virtual clock; each trial is a fork of one chain in
motion, so that each meets it in another phase. Exit code 1 if anything is out of bounds.
"""

from __future__ import annotations

import argparse
import os
import pickle
import random
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from pam_check.faults.chain import FaultChain
from pam_check.faults.report import as_markdown, write_report
from pam_check.faults.trial import Trial, draw_values, run_trial
from pam_control.controller_parameters import create_controller, parameter_table
from pam_driver.boards.pam_board.codec import BoardCodec
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_sim.faults.kinds import KINDS, FaultKind

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
    chain = FaultChain(rig, BoardCodec.from_dbc(), create_controller(rig, values, names), seed)
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run it; 0 if all is inside the bounds, 1 if not, 2 for a user's mistake."""
    parser = argparse.ArgumentParser(
        prog="python -m pam_check.faults.campaign", description=__doc__
    )
    parser.add_argument("--rig", type=Path, default=Path("config/elbow.yaml"))
    parser.add_argument("--trials", type=int, default=8 * len(KINDS), help="in all")
    parser.add_argument("--kind", action="append", help="only this kind; may be repeated")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/faults"))
    parser.add_argument("--page", type=Path, help="write the table here too, for the documentation")
    parsed = parser.parse_args(arguments)
    kinds = [kind for kind in KINDS if not parsed.kind or kind.name in parsed.kind]
    if not kinds or parsed.trials < 1:
        print(f"no such fault; there are {', '.join(k.name for k in KINDS)}", file=sys.stderr)
        return 2
    done: list[Trial] = []
    try:
        for trial in run_campaign(load_rig(parsed.rig), kinds, parsed.trials, parsed.seed):
            done.append(trial)
            if trial.problem:
                print(f"{trial.kind} {trial.values}: {trial.problem}", file=sys.stderr)
    except PamError as error:
        print(error, file=sys.stderr)
        return 2
    bad = sum(bool(trial.problem) for trial in done)
    page = write_report(kinds, done, parsed.out)
    if parsed.page:
        given = sys.argv[1:] if arguments is None else arguments
        command = " ".join(["python -m pam_check.faults.campaign", *given])
        parsed.page.write_text(as_markdown(kinds, done, command), encoding="utf-8")
    print(f"{len(done)} injections of {len(kinds)} kinds, {bad} out of bounds: {page}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
