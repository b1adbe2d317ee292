"""The answer of a diagnosis: the content of diagnosis.json, and what the report needs besides."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pam_gap.answer.notebook_view import NumberRow, as_frame, as_html
from pam_gap.answer.provenance import Provenance
from pam_gap.experiments.next_experiment import Proposal
from pam_gap.inference.confidence import Interval
from pam_gap.inference.hypothesis import Hypothesis
from pam_gap.inference.probabilities import cause_probabilities
from pam_gap.prediction.gap_figures import GapFigure
from pam_gap.prediction.locate import Location
from pam_gap.prediction.materiality import GapSize
from pam_model.command_line import plain
from pam_model.rig import Rig

if TYPE_CHECKING:
    import pandas as pd


_AS_THEY_ARE: Final = (
    "verdict", "stage", "effects", "candidates", "indistinguishable", "gap", "closed",
    "probabilities", "cause_probabilities", "withheld", "next_experiment", "sentence", "joint",
    "horizons", "repairs", "left_out", "missing", "cautions", "not_shown", "preferred",
    "looks_like", "ordinary", "facts",
)  # fmt: skip
"""What diagnosis.json holds under the names that it has in `Diagnosis`."""
_OF_A_SIZE: Final = (
    "motion", "before", "retuned", "after", "limit", "limit_unexplained", "background", "unit",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FoundParameter:
    """One parameter of a named effect with its 90 % interval."""

    interval: Interval
    unit: str


@dataclass(frozen=True, slots=True)
class ChannelGap:
    """RMS prediction error of a channel on held-out data, in the channel's unit."""

    before: float
    after: float
    floor: float
    unit: str


@dataclass(frozen=True, slots=True)
class ScoredCandidate:
    """The error that remains with one hypothesis on held-out data.

    Attributes
    ----------
    effects : tuple of str
        Effects of the hypothesis.
    remaining : Interval
        Share of the RMS gap that remains.
    note : str
        Reasons to doubt the hypothesis.
    level : float
        Sum over channels of the log of mean squared error over floor.
    over_floor : tuple of float
        RMS error over floor of each recorded channel.
    label : str
        The effects with the side of one-sided ones, by which two hypotheses of one effect differ.
    """

    effects: tuple[str, ...]
    remaining: Interval
    note: str = ""
    level: float = 0.0
    over_floor: tuple[float, ...] = ()
    label: str = ""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The answer for one joint.

    Attributes
    ----------
    verdict : str
        named, ambiguous, unknown, none or not_identifiable.
    stage : str or None
        valve, muscle, joint or sensing.
    effects : tuple of str
        Effects that the verdict names, most probable first.
    candidates : tuple of (str, float)
        Every candidate with its probability, the named ones first.
    indistinguishable : tuple of tuple of str
        Sets of effects between which the data cannot distinguish.
    parameters : mapping
        Effect -> parameter -> value, interval, unit.
    gap : mapping
        Channel -> RMS error before and after, and its floor, on held-out data.
    closed : Interval or None
        (before - after)/(before - floor) of the pooled RMS error; None without named effects.
    next_experiment : str
        Instruction for the next recording; empty if none is needed.
    probabilities : mapping
        Explanation (effects joined by " + ", `unknown` or `none`) -> probability; empty if the
        data do not suffice.
    missing : tuple of str
        For `not_identifiable`: what the recordings lack, in full sentences.
    cautions : tuple of str
        What makes the answer less certain than it looks, in full sentences.
    provenance : Provenance or None
        What the answer was made from; None for recordings in memory.
    preferred : str
        Why the named explanation was preferred to one that fits better; empty if it fits best.
    looks_like : str
        For `unknown`: the cause outside the table of effects that explains the gap better than the
        effects of the table, in words; empty if none does.
    sizes : tuple of GapSize
        The gap of each channel in its unit and as a share of the motion, largest share first.
    material_share, unexplained_share : float
        Shares of the motion below which a gap does not matter, and one that no effect explains.
    not_shown : tuple of str
        Effects that would stay below the noise in these recordings at their usual size.
    improved, retuned : Rig or None
        The rig with the effects that were found; for `unknown`, with its numbers changed within
        their tolerance.
    closest_values : ndarray or None
        For `unknown`: parameters of the plant with the effects that come closest.
    ordinary : tuple of str
        Effects that the chosen hypothesis contains but that are no larger than on an ordinary good
        rig. They belong to the background and are not named.
    withheld : str
        What was withheld from the fits whose errors are told, in words.
    at_the_end : tuple of str
        Effects that also explain most of the gap, with a size at the end of the range that is
        searched; with more of them they might explain as much as those that are named.
    """

    verdict: str
    stage: str | None
    effects: tuple[str, ...]
    candidates: tuple[tuple[str, float], ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, Mapping[str, FoundParameter]]
    gap: Mapping[str, ChannelGap]
    closed: Interval | None
    next_experiment: str
    probabilities: Mapping[str, float] = field(default_factory=dict)
    sentence: str = ""
    joint: str = ""
    ranking: tuple[ScoredCandidate, ...] = ()
    location: Location | None = None
    horizons: tuple[GapFigure, ...] = ()
    repairs: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    not_shown: tuple[str, ...] = ()
    provenance: Provenance | None = None
    preferred: str = ""
    looks_like: str = ""
    sizes: tuple[GapSize, ...] = ()
    material_share: float = 0.0
    unexplained_share: float = 0.0
    ordinary: tuple[str, ...] = ()
    withheld: str = ""
    at_the_end: tuple[str, ...] = ()
    improved: Rig | None = None
    retuned: Rig | None = None
    survivors: tuple[Hypothesis, ...] = ()
    proposal: Proposal | None = None
    written_values: Any = None
    improved_values: Any = None
    closest_values: Any = None
    facts: Mapping[str, float] = field(default_factory=dict)

    @property
    def cause_probabilities(self) -> dict[str, float]:
        """Of each effect that the answer names, see `cause_probabilities`."""
        named = {*self.effects, *(one for group in self.indistinguishable for one in group)}
        return cause_probabilities(self.probabilities, named)

    def to_pandas(self) -> pd.DataFrame:
        """The numbers of the named effects: value, ends of the 90 % interval, unit."""
        return as_frame(self._number_rows())

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        gaps = [
            (name, gap.before, gap.after, gap.floor, gap.unit) for name, gap in self.gap.items()
        ]
        return as_html(f"{self.joint}: {self.verdict}", self.sentence, self._number_rows(), gaps)

    def _number_rows(self) -> list[NumberRow]:
        return [
            (
                effect,
                name,
                found.interval.value,
                found.interval.low,
                found.interval.high,
                found.unit,
            )
            for effect, numbers in self.parameters.items()
            for name, found in numbers.items()
        ]

    def to_json(self) -> dict[str, Any]:
        """The mapping that diagnosis.json holds; numbers that are not finite are None."""
        where = self.location
        document: dict[str, Any] = plain(
            {name: getattr(self, name) for name in _AS_THEY_ARE}
            | {
                "parameters": {
                    effect: {
                        name: asdict(found.interval) | {"unit": found.unit}
                        for name, found in values.items()
                    }
                    for effect, values in self.parameters.items()
                },
                "at_the_end_of_their_range": self.at_the_end,
                "ranking": [
                    asdict(entry) | {"label": entry.label or " + ".join(entry.effects)}
                    for entry in self.ranking
                ],
                "stages": () if where is None else where.stages,
                "delays": {} if where is None else dict(where.delays),
                "regimes": {} if where is None else dict(where.regimes),
                "provenance": None if self.provenance is None else self.provenance.to_json(),
                "leftover": self.leftover(),
                "materiality": {
                    "limit": self.material_share,
                    "limit_unexplained": self.unexplained_share,
                    "material": any(size.is_material for size in self.sizes),
                    "channels": {
                        size.channel: {name: getattr(size, name) for name in _OF_A_SIZE}
                        for size in self.sizes
                    },
                },
            }
        )
        return document

    def leftover(self) -> dict[str, Any] | None:
        """What the answer does not explain, in the channel where it is largest; None without data.

        The errors contain no noise: the floor is subtracted in squares.
        """
        if not self.sizes:
            return None
        size = max(self.sizes, key=lambda s: s.share_left)
        return {
            "material": size.leaves_material,
            "ordinary": size.leaves_ordinary,
            "stage": size.stage,
            "channel": size.channel,
            "rms": size.after,
            "share_of_motion": size.share_left,
            "unit": size.unit,
        }

    def write(self, path: Path) -> None:
        """Write diagnosis.json."""
        path.write_text(json.dumps(self.to_json(), indent=1) + "\n", encoding="utf-8")
