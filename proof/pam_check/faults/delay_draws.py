"""One delay on the way of commands or measurements and one hidden effect, drawn at random.

`pam check delays --draws 500` asks one question of every draw: does the joint stay below
the speed limit in its rig file, and does the loop either track or stop? The controller knows
neither the delay nor the effect. Frames are delayed without a trace; messages between the processes
carry stamps that tell their age.

The gains are designed for an unknown delay of `design.extra_delay` (10 ms), so that a loop with
less than this should track. Where it does not, the draw is repeated without its delay, which tells
whether the effect alone stops it.
"""

from __future__ import annotations

import csv
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Final

from pam_check.faults.campaign import in_a_fork, in_forks, make_chain
from pam_check.faults.chain import FaultChain
from pam_check.faults.hidden_effects import moderate
from pam_check.faults.injections import INJECTIONS
from pam_check.faults.rig_bounds import EMPTY, RigBounds, bounds_of
from pam_check.faults.trial import AT_REST
from pam_driver.safety.states import SafetyState
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.rig import load_rig

PLACES: Final = (
    "frames_delayed_down", "frames_delayed_up", "commands_delayed", "measurements_delayed"
)  # fmt: skip
LONGEST: Final = 0.08  # s
MOTION: Final = 3.0  # s
JUDGED: Final = 1.0  # s; a loop that still runs must track at the end of the motion
BORNE: Final = 0.01  # s, the unknown delay for which the gains are designed
RANGES: Final = (BORNE, 0.02, 0.04, LONGEST)  # s, for the summary
TRACKS, STOPS, NEITHER = "tracks", "stops", "neither"


@dataclass(slots=True)
class DelayDraw:
    """One draw and what followed."""

    place: str  # where messages are delayed, by the name of the fault
    delay: float  # [s]
    effect: str  # the hidden effect
    outcome: str = NEITHER  # `TRACKS`, `STOPS` or `NEITHER`
    peak_speed: float = 0.0  # largest true speed of the first joint [rad/s]
    # peak_error, last_error: largest true angle error while air moves, in all and in the last
    # second [rad]
    peak_error: float = 0.0
    last_error: float = 0.0
    by: str = ""  # what stopped it
    # what followed without the delay: `TRACKS`, `STOPS` or `NEITHER`; only asked where a delay
    # below `BORNE` was not borne, else empty
    alone: str = ""

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
    if drawn.delay > 0.0:
        INJECTIONS[drawn.place](chain, {"delay": drawn.delay}, random.Random(seed))
    end = chain.now + MOTION
    while chain.now < end and not _at_rest(chain):
        chain.step()
    if chain.driver.state is not SafetyState.ACTIVE:
        drawn.outcome = STOPS
    elif drawn.last_error < bounds_of(chain.rig).tracking_error:
        drawn.outcome = TRACKS
    return drawn


def _at_rest(chain: FaultChain) -> bool:
    """Whether the driver has stopped, no muscle holds air and the joint no longer moves."""
    truth = chain.truth
    return (
        chain.driver.state is not SafetyState.ACTIVE
        and not chain.moves_air
        and max(truth.pressures) < EMPTY
        and abs(truth.velocities[0]) < AT_REST
    )


def judge_draw(chain: FaultChain, drawn: DelayDraw, seed: int) -> DelayDraw:
    """Run a draw, and once more without its delay if a loop that should bear it did not track."""
    done = in_a_fork(partial(run_draw, chain, drawn, seed))
    if done.delay < BORNE and done.outcome != TRACKS:
        done.alone = run_draw(chain, replace(drawn, delay=0.0), seed).outcome
    return done


def draws(count: int, seed: int) -> Iterator[tuple[DelayDraw, int]]:
    """Draw delays and effects, and a seed for each; every effect meets every place."""
    draw = random.Random(seed)
    names = list(EFFECTS)
    for n in range(count):
        place = PLACES[n // len(names) % len(PLACES)]
        drawn = DelayDraw(place, draw.uniform(0.0, LONGEST), names[n % len(names)])
        yield drawn, draw.randrange(1 << 30)


def run_draws(
    rig_path: Path, count: int, seed: int, at_once: int, after: int = 0
) -> Iterator[DelayDraw]:
    """Run the draws of this seed, without the first ones."""
    chain = make_chain(load_rig(rig_path), seed)
    works = (
        partial(judge_draw, chain, *drawn) for drawn in islice(draws(count, seed), after, None)
    )
    yield from in_forks(works, at_once)


def read_draws(table: Path, seed: int) -> list[DelayDraw]:
    """Read the draws of this seed that a table holds.

    Raises
    ------
    PamError
        If the table is no table of draws, or one of another seed.
    """
    done = []
    try:
        with table.open(encoding="utf-8", newline="") as rows:
            for row in csv.DictReader(rows):
                done.append(
                    DelayDraw(
                        row["place"], float(row["delay"]), row["effect"], row["outcome"],
                        float(row["peak_speed"]), float(row["peak_error"]),
                        float(row["last_error"]), row["by"], row["alone"],
                    )
                )  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise PamError(f"{table}: no table of delays: {error}") from error
    for one, (wanted, _) in zip(done, draws(len(done), seed), strict=True):
        if (one.place, one.delay, one.effect) != (wanted.place, wanted.delay, wanted.effect):
            raise PamError(f"{table}: not the draws of --seed {seed}")
    return done


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


def not_borne(done: Sequence[DelayDraw]) -> list[str]:
    """The draws with a delay that the gains should bear, and that did not track; one line each."""
    return [
        f"{drawn.place} {1e3 * drawn.delay:.1f} ms, {drawn.effect}: {drawn.outcome}"
        f"{f' by {drawn.by}' if drawn.by else ''}; without the delay it {drawn.alone}"
        for drawn in done
        if drawn.delay < BORNE and drawn.outcome != TRACKS
    ]


def run(given: Arguments) -> Outcome:
    """Run the draws and write their table; the command of `pam_check.__main__`."""
    path = chosen_rig(given)
    bounds = bounds_of(load_rig(path))
    resumed = given.resume and given.out.exists()
    done = read_draws(given.out, given.seed)[: given.draws] if resumed else []
    with (
        make_parents(given.out).open("a" if resumed else "w", encoding="utf-8", newline="") as out,
        progress(given.draws, "delays") as bar,
    ):
        table = csv.DictWriter(out, [field.name for field in fields(DelayDraw)])
        if not resumed:
            table.writeheader()
        for drawn in run_draws(path, given.draws, given.seed, given.jobs, len(done)):
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
    ranges, stopped = by_delay(done), not_borne(done)
    print("\n".join([*ranges, *stopped]))
    numbers = {"draws": len(done), "ranges": ranges, "outcomes": dict(outcomes), "fastest": fastest}
    return Outcome(
        {**numbers, "not_borne": stopped, "too_fast": too_fast, "page": given.out}, problems
    )
