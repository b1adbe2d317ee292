"""Injects every fault many times and compares the reactions with docs/safety_tables.md.

`pam check faults --trials 600 --out out/faults` runs boards, plant, bus, driver, model
and controller in one process on a virtual clock. Each trial is a fork of one moving chain, so each
fault occurs in another phase of the motion.
"""

from __future__ import annotations

import os
import pickle
import random
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

from pam_check.fault_kinds.fault_kind import FaultKind
from pam_check.fault_kinds.kinds import ALL_KINDS, KINDS
from pam_check.faults.chain import FaultChain
from pam_check.faults.chosen_kinds import kinds_called, kinds_for
from pam_check.faults.report import as_markdown, write_report
from pam_check.faults.trial import Trial, draw_values, run_trial
from pam_check.faults.unavoidable_speed import HELD_ANGLE
from pam_control.controller_parameters import COMMAND_DELAY, create_controller, parameter_table
from pam_driver.boards.wiring import RigWiring, kind_name
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_robot.direct_link import COMMAND_DELAY as ONE_PROCESS_DELAY

TRIALS = 1000  # by default, and at least one of each kind
LONGEST_PHASE = 0.4  # s, between two trials; the motion's period is 1.7 s


BETWEEN_PROCESSES = ("controller_", "commands_delayed", "commands_jitter", "measurements_")
"""Beginnings of the names of faults that one process cannot have: nothing is on its way there."""


def make_chain(rig: Rig, seed: int = 0, *, one_process: bool = False) -> FaultChain:
    """Start a chain of this rig and bring it into motion.

    With `one_process`, the controller takes part in the driver's cycle.

    Raises
    ------
    PamError
        If it cannot be started, or a joint does not reach far enough.
    """
    for joint in rig.joints:
        low, high = joint.position_limits
        if low > -HELD_ANGLE or high < HELD_ANGLE:
            raise PamError(
                f"{joint.name}.position_limits = [{low:g}, {high:g}] rad: the motions of the fault "
                f"campaign need {-HELD_ANGLE:g} to {HELD_ANGLE:g} rad"
            )
    names = rig.joint_names
    delay = ONE_PROCESS_DELAY if one_process else COMMAND_DELAY
    values = {entry.name: entry.default for entry in parameter_table(names, delay)}
    controller = create_controller(rig, values, names)
    chain = FaultChain(rig, controller, seed, one_process=one_process)
    chain.start()
    return chain


class _Fork[Result]:
    """A function that runs in a fork of this process, so that it leaves no changes here."""

    def __init__(self, work: Callable[[], Result]) -> None:
        self._reading, writing = os.pipe()
        self._child = os.fork()
        if self._child == 0:
            code = 1
            try:
                signal.signal(signal.SIGINT, signal.SIG_DFL)
                os.close(self._reading)
                with os.fdopen(writing, "wb") as out:
                    pickle.dump(work(), out)
                code = 0
            except Exception as error:
                print(f"fault campaign: {type(error).__name__}: {error}", file=sys.stderr)
            finally:
                os._exit(code)
        os.close(writing)

    def result(self) -> Result:
        """Wait for the result.

        Raises
        ------
        PamError
            If the fork ended without one.
        """
        with os.fdopen(self._reading, "rb") as result:
            data = result.read()
        os.waitpid(self._child, 0)
        if not data:
            raise PamError("a trial ended without a result")
        found: Result = pickle.loads(data)  # the data are from our own fork
        return found


def in_a_fork[Result](work: Callable[[], Result]) -> Result:
    """Run a function in a fork of this process, so that it leaves no changes here.

    Raises
    ------
    PamError
        If the fork ends without a result.
    """
    return _Fork(work).result()


def in_forks[Result](works: Iterable[Callable[[], Result]], at_once: int) -> Iterator[Result]:
    """Run functions in forks, several at once; a fork begins when its function is drawn."""
    running: deque[_Fork[Result]] = deque()
    for work in works:
        running.append(_Fork(work))
        if len(running) >= at_once:
            yield running.popleft().result()
    for fork in running:
        yield fork.result()


def run_campaign(
    rig: Rig,
    kinds: Sequence[FaultKind],
    trials: int,
    seed: int,
    at_once: int = 1,
    *,
    one_process: bool = False,
) -> Iterator[Trial]:
    """Run trials of all kinds in turn.

    Parameters
    ----------
    rig : Rig
        The simulated rig.
    kinds : sequence of FaultKind
        The faults.
    trials : int
        Total number of trials.
    seed : int
        Seed of all random draws.
    at_once : int, optional
        Number of trials that run at the same time.
    one_process : bool, optional
        As for `make_chain`.
    """
    chain = make_chain(rig, seed, one_process=one_process)
    draw = random.Random(seed)

    def works() -> Iterator[Callable[[], Trial]]:
        for number in range(trials):
            kind = kinds[number % len(kinds)]
            chain.wait(draw.uniform(0.0, LONGEST_PHASE))
            values, trial_seed = draw_values(kind, draw, rig), draw.randrange(1 << 30)
            yield partial(run_trial, chain, kind, values, trial_seed)

    yield from in_forks(works(), at_once)


def run(given: Arguments) -> Outcome:
    """Run the campaign and write its report; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig or a fault that cannot be used.
    """
    rig = load_rig(chosen_rig(given))
    boards = {kind_name(wired) for wired in RigWiring(rig).boards.values()}
    kinds = kinds_called(given.kind, ALL_KINDS if given.kind else kinds_for(boards))
    if given.one_process:
        kinds = [kind for kind in kinds if not kind.name.startswith(BETWEEN_PROCESSES)]
    trials = given.trials or max(TRIALS * len(kinds) // len(KINDS), len(kinds))
    done: list[Trial] = []
    with progress(trials, "fault campaign") as bar:
        campaign = run_campaign(
            rig, kinds, trials, given.seed, given.jobs, one_process=given.one_process
        )
        for trial in campaign:
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
    """The command that makes the same table again, for the page with the table."""
    words = ["./pam check faults"]
    words += [] if given.rig is None else [f"--rig {given.rig}"]
    words += [] if given.trials is None else [f"--trials {given.trials}"]
    words += [f"--kind {name}" for name in given.kind or ()]
    words += ["--one-process"] if given.one_process else []
    return " ".join([*words, f"--seed {given.seed}", f"--page {given.page}"])
