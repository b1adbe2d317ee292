"""One delay on the way of commands or measurements and one hidden effect, drawn at random.

`python -m pam_check delays --draws 500` asks one question of every draw: does the joint stay below
the speed limit in its rig file, and does the loop either track or stop? The controller knows
neither the delay nor the effect. Frames are delayed without a trace; messages between the processes
carry stamps that tell their age.
"""

from __future__ import annotations

import csv
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Final

from pam_check.faults.campaign import in_forks, make_chain
from pam_check.faults.chain import FaultChain
from pam_check.faults.hidden_effects import moderate
from pam_check.faults.injections import INJECTIONS
from pam_check.faults.rig_bounds import RigBounds, bounds_of
from pam_driver.safety.states import SafetyState
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, chosen_rig, progress
from pam_model.effects import EFFECTS
from pam_model.rig import load_rig

PLACES: Final = (
    "frames_delayed_down", "frames_delayed_up", "commands_delayed", "measurements_delayed"
)  # fmt: skip
LONGEST: Final = 0.08  # s
MOTION: Final = 3.0  # s
JUDGED: Final = 1.0  # s; a loop that still runs must track at the end of the motion
RANGES: Final = (0.01, 0.02, 0.04, LONGEST)  # s, for the summary
TRACKS, STOPS, NEITHER = "tracks", "stops", "neither"


@dataclass(slots=True)
class DelayDraw:
    """One draw and what followed.

    Attributes
    ----------
    place : str
        Where messages are delayed, by the name of the fault.
    delay : float
        [s].
    effect : str
        The hidden effect.
    outcome : str
        `TRACKS`, `STOPS` or `NEITHER`.
    peak_speed : float
        Largest true speed of the first joint [rad/s].
    peak_error, last_error : float
        Largest true angle error while air moves, in all and in the last second [rad].
    by : str
        What stopped it.
    """

    place: str
    delay: float
    effect: str
    outcome: str = NEITHER
    peak_speed: float = 0.0
    peak_error: float = 0.0
    last_error: float = 0.0
    by: str = ""

    def problem(self, bounds: RigBounds) -> str:
        """What is out of bounds; empty if nothing is."""
        what = f"{self.place} {1e3 * self.delay:.0f} ms, {self.effect}"
        if self.peak_speed > bounds.speed:
            return f"{what}: {self.peak_speed:.1f} rad/s"
        return f"{what}: neither tracks nor stops" if self.outcome == NEITHER else ""


def run_draw(chain: FaultChain, drawn: DelayDraw, seed: int) -> DelayDraw:
    """Move a rig with this effect and this delay; the chain cannot be used afterwards."""
    end = chain.now + 1e3

    def look(now: float) -> None:
        truth = chain.truth
        drawn.peak_speed = max(drawn.peak_speed, abs(truth.velocities[0]))
        if chain.moves_air:
            error = abs(truth.positions[0] - chain.reference)
            drawn.peak_error = max(drawn.peak_error, error)
            if now > end - JUDGED:
                drawn.last_error = max(drawn.last_error, error)
        if chain.driver.faults and not drawn.by:
            drawn.by = chain.driver.faults[0].kind

    chain.after.append(look)
    chain.power_cycle(moderate(drawn.effect))
    INJECTIONS[drawn.place](chain, {"delay": drawn.delay}, random.Random(seed))
    end = chain.now + MOTION
    chain.wait(MOTION)
    if chain.driver.state is not SafetyState.ACTIVE:
        drawn.outcome = STOPS
    elif drawn.last_error < bounds_of(chain.rig).tracking_error:
        drawn.outcome = TRACKS
    return drawn


def run_draws(rig_path: Path, count: int, seed: int, at_once: int) -> Iterator[DelayDraw]:
    """Draw delays and effects; every effect meets every place."""
    draw = random.Random(seed)
    chain = make_chain(load_rig(rig_path), seed)
    names = list(EFFECTS)
    works = (
        partial(
            run_draw,
            chain,
            DelayDraw(
                PLACES[n // len(names) % len(PLACES)],
                draw.uniform(0.0, LONGEST),
                names[n % len(names)],
            ),
            draw.randrange(1 << 30),
        )
        for n in range(count)
    )
    yield from in_forks(works, at_once)


def by_delay(done: Sequence[DelayDraw]) -> list[str]:
    """What followed in each range of delays, and what stopped the loop there; one line each."""
    lines, low = [], 0.0
    for high in RANGES:
        mine = [drawn for drawn in done if low <= drawn.delay <= high]
        stopped = Counter(drawn.by for drawn in mine if drawn.outcome == STOPS)
        by = ", ".join(f"{kind} {count}" for kind, count in stopped.most_common())
        lines.append(
            f"{1e3 * low:2.0f} to {1e3 * high:2.0f} ms: {len(mine)} draws, "
            f"{sum(drawn.outcome == TRACKS for drawn in mine)} track, "
            f"{stopped.total()} stop{f' ({by})' if by else ''}"
        )
        low = high
    return lines


def run(given: Arguments) -> Outcome:
    """Run the draws and write their table; the command of `pam_check.__main__`."""
    path = chosen_rig(given)
    bounds = bounds_of(load_rig(path))
    done: list[DelayDraw] = []
    with (
        make_parents(given.out).open("w", encoding="utf-8", newline="") as out,
        progress(given.draws, "delays") as bar,
    ):
        table = csv.DictWriter(out, [field.name for field in fields(DelayDraw)])
        table.writeheader()
        for drawn in run_draws(path, given.draws, given.seed, given.jobs):
            table.writerow(asdict(drawn))
            out.flush()  # a run that is interrupted keeps its draws
            done.append(drawn)
            bar.show(len(done), drawn.effect)
    outcomes = Counter(drawn.outcome for drawn in done)
    problems = [problem for drawn in done if (problem := drawn.problem(bounds))]
    fastest = max(drawn.peak_speed for drawn in done)
    too_fast = sum(drawn.peak_speed > bounds.speed for drawn in done)
    print(
        f"{len(done)} draws: {outcomes[TRACKS]} track, {outcomes[STOPS]} stop, "
        f"{outcomes[NEITHER]} do neither; fastest joint {fastest:.1f} rad/s, "
        f"{too_fast} above {bounds.speed:g} rad/s: {given.out}"
    )
    ranges = by_delay(done)
    print("\n".join(ranges))
    numbers = {"draws": len(done), "ranges": ranges, "outcomes": dict(outcomes), "fastest": fastest}
    return Outcome({**numbers, "too_fast": too_fast, "page": given.out}, problems)
