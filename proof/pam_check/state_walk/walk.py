"""The walk over all states that can be reached, breadth first, so that a path found is shortest."""

from __future__ import annotations

import gc
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from pam_check.state_walk.acts import ACTS, OF_TWO_PROCESSES, Act, carry_out
from pam_check.state_walk.fingerprint import Snapshots, fingerprint
from pam_check.state_walk.system import System, make_system
from pam_check.state_walk.watcher import Watcher
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig

MOST_STATES: Final = 500_000


@dataclass(frozen=True, slots=True)
class Violation:
    """Air that moves although it must not."""

    complaint: str  # what is wrong
    path: tuple[str, ...]  # the shortest sequence of acts that leads there

    def __str__(self) -> str:
        steps = "\n".join(f"  {number}. {act}" for number, act in enumerate(self.path, 1))
        return f"{self.complaint}:\n{steps}"


@dataclass(frozen=True, slots=True)
class Walk:
    """The result of a walk."""

    # states, transitions: number of different states, and of possible acts in all of them
    states: int
    transitions: int
    moving: int  # number of states in which air moves
    driver_states: tuple[str, ...]  # states of the driver that were reached
    violations: tuple[Violation, ...]  # the first of each kind, the shortest path first


def walk(
    rig: Rig,
    acts: Mapping[str, Act] = ACTS,
    *,
    ends_early: bool = False,
    one_process: bool = False,
) -> Walk:
    """Visit every state; beyond a violation the walk does not go on.

    Parameters
    ----------
    rig : Rig
        A rig with one board and flow valves.
    acts : mapping of str to Act, optional
        What may happen.
    ends_early : bool, optional
        End with the first violation.
    one_process : bool, optional
        Driver and controller are one process.

    Raises
    ------
    PamError
        If the walk does not end, because something that counts without limit is in the key.
    """
    # every restored system is garbage soon; what is there already need not be looked at each time
    gc.collect()
    gc.freeze()
    try:
        system = make_system(rig, one_process=one_process)
        possible = {
            name: act for name, act in acts.items() if not (one_process and act in OF_TWO_PROCESSES)
        }
        return _walk(system, possible, ends_early=ends_early)
    finally:
        gc.unfreeze()


def _walk(system: System, acts: Mapping[str, Act], *, ends_early: bool) -> Walk:
    snapshots = Snapshots()
    watcher = Watcher()
    origins: dict[bytes, tuple[bytes, str] | None] = {}
    start = fingerprint((system, watcher), system.now)
    origins[start] = None
    waiting = deque([(start, snapshots.store((system, watcher)))])
    found: dict[str, Violation] = {}
    reached: set[str] = set()
    transitions = moving = 0
    while waiting and not (ends_early and found):
        key, stored = waiting.popleft()
        untouched = False
        for name, act in acts.items():
            if not untouched:
                system, watcher = snapshots.restore(stored)
            untouched = not carry_out(act, system, watcher)
            if untouched:
                continue
            transitions += 1
            complaint = watcher.judge(system)
            if complaint:
                path = (*reversed(list(_back(origins, key))), name)
                found.setdefault(complaint, Violation(complaint, path))
                continue
            after = fingerprint((system, watcher), system.now)
            if after in origins:
                continue
            origins[after] = (key, name)
            moving += system.opening > 0.0
            if system.driver is not None:
                reached.add(system.driver.state.value)
            waiting.append((after, snapshots.store((system, watcher))))
        if len(origins) > MOST_STATES:
            raise PamError(f"more than {MOST_STATES} states: a counter may be part of the key")
    return Walk(len(origins), transitions, moving, tuple(sorted(reached)), tuple(found.values()))


def _back(origins: Mapping[bytes, tuple[bytes, str] | None], key: bytes) -> Iterator[str]:
    """The acts that led to a state, the last one first."""
    origin = origins[key]
    while origin is not None:
        yield origin[1]
        origin = origins[origin[0]]


def run(given: Arguments) -> Outcome:
    """Walk and print what was found; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig that cannot be used.
    """
    result = walk(load_rig(chosen_rig(given)), one_process=given.one_process)
    print(
        f"{result.states} states and {result.transitions} transitions; air moves in "
        f"{result.moving} states; the driver was {', '.join(result.driver_states)}"
    )
    for violation in result.violations:
        print(violation)
    if not result.violations:
        print(
            "no path leads from a stop or a fault to moving air without clearing the fault, an "
            "activation and a fresh command"
        )
    return Outcome(result, [violation.complaint for violation in result.violations])
