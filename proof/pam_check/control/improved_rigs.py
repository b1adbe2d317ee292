"""How much better the controller tracks a rough rig with the rig file that a diagnosis improved.

`pam check improved-rig` hides an effect as `rough-control` does. The controller, which
has the nominal rig file, plays both motions. What its sensors and its log show of them is
diagnosed. The controller then plays the motions with other noise, with either rig file.
Both are shown without adaptation, where the rig file alone counts, and with it, for motions that
are played for the first time.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import pandas as pd

from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import PERIOD, TOLD, Muscles, RunTrace, play
from pam_check.control.hidden_rigs import chosen_rigs
from pam_check.control.rough_control import RoughControl
from pam_control.controller import Controller
from pam_gap import Recording, diagnose, import_recording
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig

ADAPTING: Final = TOLD.replace(adaptation=True)
OTHER_NOISE: Final = 100  # added to the seed of the runs that are compared
WORTH: Final = 1e-3  # rad; a smaller error need not become smaller
ENOUGH: Final = 0.5  # of the error before, where that is worth it
NOT_WORSE: Final = 1.05  # times the error before; the noise of the sensors makes this difference


@dataclass(frozen=True, slots=True)
class ImprovedResult:
    """One effect.

    Attributes
    ----------
    effect : str
        What was hidden.
    verdict : str
        What the diagnosis named, joined by "+"; its verdict if it named nothing.
    written : bool
        Whether it wrote an improved rig file; otherwise the errors after are those before.
    before, after : dict of str to dict of str to float
        RMS errors [rad] by way ("fixed" without, "adapting" with adaptation) and motion.
    """

    effect: str
    verdict: str
    written: bool
    before: Mapping[str, Mapping[str, float]]
    after: Mapping[str, Mapping[str, float]]

    def share(self, way: str) -> float:
        """Largest error after over before, of the motions whose error was worth it, or of all."""
        before, after = self.before[way], self.after[way]
        worth = [name for name, error in before.items() if error > WORTH] or list(before)
        return max(after[name] / before[name] for name in worth)

    def worse(self, way: str) -> bool:
        """Whether a motion is worse than before."""
        before, after = self.before[way], self.after[way]
        return any(after[name] > NOT_WORSE * before[name] for name in before)


def recorded(trace: RunTrace, rig: Rig, path: Path) -> Recording:
    """The run as a log shows it: commands when they were sent to the valves, and sensors."""
    joint = rig.joints[0]
    count = len(trace.measured)
    table = {"time": [k * PERIOD for k in range(count)]}
    for side, muscle in enumerate(joint.muscles):
        # computed from a sample, sent with the next one
        table[f"valve_commands.{muscle}"] = [0.0, *trace.commands[:-1, side].tolist()]
        table[f"pressure_states.{muscle}"] = trace.pressures[:, side].tolist()
    table[f"joint_states.{joint.name}.position"] = trace.measured.tolist()
    pd.DataFrame(table).to_csv(path, index=False, float_format="%.7g")
    return import_recording(path)


def recordings(
    rough: RoughControl, joint: TruthJoint, muscles: Muscles, seed: int, folder: Path
) -> list[Recording]:
    """What a log shows of all motions, played with the rig file as written by a law that adapts."""
    law = Controller(rough.rig, ADAPTING, rough.designs)
    logs = []
    for name, points in rough.motions.items():
        law.forget_adaptation()
        _, trace = play(law, joint, muscles, points, seed)
        logs.append(recorded(trace, rough.rig, folder / f"{name}.csv"))
    return logs


def run_effect(rough: RoughControl, effect: str, seed: int, folder: Path) -> ImprovedResult:
    """Play, diagnose, play again."""
    joint, muscles = rough.hidden(effect)
    ways = {"fixed": TOLD.replace(adaptation=False), "adapting": ADAPTING}

    def errors(rig: Rig, way: str, seed: int) -> dict[str, float]:
        law = Controller(rig, ways[way], rough.designs)
        found = {}
        for name, points in rough.motions.items():
            law.forget_adaptation()
            found[name] = play(law, joint, muscles, points, seed)[0].rms
        return found

    logs = recordings(rough, joint, muscles, seed, folder)
    before = {way: errors(rough.rig, way, seed + OTHER_NOISE) for way in ways}
    (answer,) = diagnose(logs, rough.rig)
    named = "+".join(answer.effects) or answer.verdict
    if answer.improved is None:
        return ImprovedResult(effect, named, False, before, before)
    after = {way: errors(answer.improved, way, seed + OTHER_NOISE) for way in ways}
    return ImprovedResult(effect, named, True, before, after)


def _row(result: ImprovedResult) -> str:
    cells = []
    for way in ("fixed", "adapting"):
        for errors in (result.before[way], result.after[way]):
            cells.append(" / ".join(f"{1e3 * error:6.2f}" for error in errors.values()))
        cells.append(f"{result.share(way):5.2f}")
    note = "" if result.written else " (no improved file)"
    return f"{result.effect:20s} {'  '.join(cells)}  {result.verdict}{note}"


def run(given: Arguments) -> Outcome:
    """Play all effects and print the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig or an effect that cannot be used.
    """
    effects = [
        each for each in chosen_rigs("--effects", given.effects, list(KNOWN)) if each in KNOWN
    ]
    rig = load_rig(chosen_rig(given))
    rough = RoughControl(rig, dataclasses.replace(TOLD, adaptation=False), given.seed)
    results: list[ImprovedResult] = []
    print("RMS error of arm / chirp [mrad] before and after, and share of the error, worse motion")
    print(f"{'hidden':20s} {'without adaptation':40s} {'adapting, first time':40s} named")
    with progress(len(effects), "effects") as bar, tempfile.TemporaryDirectory() as folder:
        for done, effect in enumerate(effects, start=1):
            results.append(run_effect(rough, effect, given.seed, Path(folder)))
            print(_row(results[-1]), flush=True)
            bar.show(done, effect)
    problems = []
    for way, words in (("fixed", "without adaptation"), ("adapting", "adapting")):
        worth = [r for r in results if any(each > WORTH for each in r.before[way].values())]
        halved = [r for r in worth if r.share(way) <= ENOUGH]
        worse = [r for r in results if r.worse(way)]
        print(
            f"{words}: of {len(worth)} effects with more than {1e3 * WORTH:g} mrad, {len(halved)} "
            f"with at most half of it; {len(worse)} of {len(results)} worse than before"
        )
        problems += [
            f"{each.effect}, {words}: {each.share(way):.2f} of the error before"
            for each in results
            if each in worse or (each in worth and each not in halved)
        ]
    document = {"seed": given.seed, "results": [asdict(each) for each in results]}
    return Outcome(document, problems)
