"""A first look at a recording (`diagnose --quick`): where the gap is, and what resembles it.

The rig is re-tuned within its tolerance, and each effect of the table gets one Gauss-Newton step
from there. This shows how much of the error it would remove alone, to first order. Nothing is
scored on data that were not fitted and no pairs are tried, so that there is no verdict and no
probability.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pam_gap.answer.user_units import percent, spoken, told
from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.hypothesis import FitTask
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.identifiable import what_is_missing
from pam_gap.prediction.locate import locate
from pam_gap.prediction.materiality import gap_sizes
from pam_gap.search.beginning_first import search_of_the_beginning
from pam_gap.search.effect_search import EffectSearch
from pam_model.effects import EFFECTS

FILE = "first_look.json"
SHOWN = 5
"""Number of effects in the list."""
CAVEAT = (
    "This is a first look and no verdict: each effect was tried alone, with one step of its fit, "
    "and nothing was tested on data that were not fitted. Run it without --quick for the answer."
)


@dataclass(frozen=True, slots=True)
class Resemblance:
    """What one effect does to the error."""

    # effect, stage: name and stage in `pam_model.effects.EFFECTS`
    effect: str
    stage: str
    # share of the RMS error above the noise that it removes, 0 to 1; the mean over the channels
    # with a gap
    removes: float


@dataclass(frozen=True, slots=True)
class RetunedGap:
    """Error of one channel without noise, in its unit: as written, and re-tuned."""

    channel: str
    unit: str
    motion: float
    before: float
    retuned: float


@dataclass(frozen=True, slots=True)
class FirstLook:
    """What a first look at the recordings of one joint shows."""

    joint: str  # name of the joint
    missing: tuple[str, ...] = ()  # why no answer is possible; empty if one is
    # the stage with the largest gap when it is simulated from its measured inputs
    stage: str | None = None
    gaps: tuple[RetunedGap, ...] = ()  # the channel with the largest share of its motion first
    # the effect that removes most of the error first; empty if the error does not matter
    effects: tuple[Resemblance, ...] = ()

    def text(self) -> str:
        """The first look for people, several lines."""
        if self.missing:
            return f"{self.joint}: no answer is possible. {' '.join(self.missing)}"
        where = f"the {self.stage} stage differs most" if self.stage else "no stage stands out"
        lines = [f"{self.joint}: {where}."]
        for gap in self.gaps:
            share = gap.before / max(gap.motion, 1e-300)
            lines.append(
                f"  {gap.channel}: wrong by {told(gap.before, gap.unit)} RMS ({percent(share)} of "
                f"its range), {told(gap.retuned, gap.unit)} re-tuned on the same data"
            )
        if self.effects:
            lines.append("  of the re-tuned error, one effect alone would remove:")
            lines += [
                f"  {percent(one.removes):>6}  {spoken(one.effect)} ({one.stage} stage)"
                for one in self.effects[:SHOWN]
            ]
        else:
            lines.append("  the error that remains after re-tuning is too small to matter")
        return "\n".join([*lines, f"  {CAVEAT}"])

    def write(self, folder: Path) -> None:
        """Write the first look to a folder."""
        text = json.dumps(self.to_json(), indent=1) + "\n"
        (folder / FILE).write_text(text, encoding="utf-8")

    def to_json(self) -> dict[str, Any]:
        """The document of first_look.json."""
        return asdict(self) | {"caveat": CAVEAT}


def first_look(engine: JointDiagnosis) -> FirstLook:
    """Look at the recordings of a diagnosis that was prepared, but not run."""
    problem, fitter = engine.problem, engine.fitter
    name = engine.rig.joint_names[engine.joint]
    missing = what_is_missing(problem)
    if missing:
        return FirstLook(name, tuple(missing))
    engine.progress("re-tuning nominal parameters", 0.1)
    nominal = fitter.fit_nominal()
    written = engine.written()
    values = fitter.vector((), nominal.result.values)
    location = locate(problem, values, nominal.simulated)
    share = engine.rules.decision.material_share
    squares = [written.mean_square, nominal.mean_square, nominal.mean_square]
    sizes = gap_sizes(problem, noise_level(problem, values), share, share, squares)
    matters = any(size.is_material for size in sizes)
    search = engine.effect_search()
    return FirstLook(
        name,
        stage=location.worst,
        gaps=tuple(RetunedGap(s.channel, s.unit, s.motion, s.before, s.retuned) for s in sizes),
        effects=_ranked(search_of_the_beginning(search) or search) if matters else (),
    )


def _ranked(search: EffectSearch) -> tuple[Resemblance, ...]:
    """The effects by the share of the error that they remove; of several starts the best."""
    nominal = search.fitter.fit_nominal()
    search.progress(f"one effect: {len(search.candidates)} candidates", 0.4)
    reuse = nominal.result.jacobian
    tried = search.fitter.fit_all(
        [
            FitTask(
                (candidate,), np.concatenate([nominal.result.values, start]), 1,
                cached=reuse,
            )
            for candidate in search.candidates
            for start in candidate.starts
        ]
    )  # fmt: skip
    usual = search.in_sample(nominal)
    removes: dict[str, float] = {}
    for one in tried:
        share = search.judge.share_removed(usual, search.in_sample(one))
        (effect,) = one.effects
        removes[effect] = max(share, removes.get(effect, 0.0))
    ranked = sorted(removes.items(), key=lambda entry: -entry[1])
    return tuple(Resemblance(effect, EFFECTS[effect].stage, share) for effect, share in ranked)
