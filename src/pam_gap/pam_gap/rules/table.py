"""All rules together: the values in use, copies with other values, and the table."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, fields, replace
from typing import Any

from pam_gap.rules.decision_rules import DecisionRules
from pam_gap.rules.experiment_rules import ExperimentRules
from pam_gap.rules.fleet_rules import FleetRules
from pam_gap.rules.prediction_rules import PredictionRules
from pam_gap.rules.recording_rules import RecordingRules
from pam_gap.rules.rule import DECISION
from pam_gap.rules.search_rules import SearchRules
from pam_gap.rules.statement import CALIBRATED, STATEMENT, Statement
from pam_model.errors import PamError
from pam_model.names import unknown


@dataclass(frozen=True, slots=True)
class Rules:
    """Every constant of the diagnosis, grouped by the step on which it acts."""

    statement: Statement = STATEMENT
    recording: RecordingRules = field(default_factory=RecordingRules)
    prediction: PredictionRules = field(default_factory=PredictionRules)
    search: SearchRules = field(default_factory=SearchRules)
    decision: DecisionRules = field(default_factory=DecisionRules)
    experiment: ExperimentRules = field(default_factory=ExperimentRules)
    fleet: FleetRules = field(default_factory=FleetRules)


DEFAULT = Rules()
"""The values in use."""


@dataclass(frozen=True, slots=True)
class RuleEntry:
    """One row of the table.

    Attributes
    ----------
    group, name : str
        Where the value is found in `Rules`.
    value : float or int
        The value in use.
    unit, decides, trades, origin : str
        Texts of the row; see `pam_gap.rules.rule.rule`.
    acts : str
        The first step that a change affects.
    """

    group: str
    name: str
    value: float
    unit: str
    decides: str
    trades: str
    origin: str
    acts: str

    @property
    def path(self) -> str:
        """Group and name in the form that `changed` expects."""
        return f"{self.group}.{self.name}"

    def scaled(self, factor: float) -> float:
        """The value times a factor; an integer stays an integer >= 1 and changes by at least 1."""
        if not isinstance(self.value, int):
            return self.value * factor
        moved = round(self.value * factor)
        if moved == self.value:
            moved += 1 if factor > 1.0 else -1
        return max(moved, 1)


def table(rules: Rules = DEFAULT) -> tuple[RuleEntry, ...]:
    """Every constant with its value and its texts; switches have no row."""
    entries = _beliefs(rules.statement)
    for group in fields(rules):
        part: Any = getattr(rules, group.name)
        for one in fields(part):
            about = one.metadata
            if not about:  # a switch
                continue
            value = getattr(part, one.name)
            entries.append(RuleEntry(group.name, one.name, value, **about))
    return tuple(entries)


def _beliefs(statement: Statement) -> list[RuleEntry]:
    """The numbers of the statement of belief, which its docstring describes."""
    told = re.findall(
        r"(?m)^    ((?:\w+, )*\w+) : float\n((?:        .*\n?)+)", Statement.__doc__ or ""
    )
    texts = {name: " ".join(text.split()) for names, text in told for name in names.split(", ")}
    return [
        RuleEntry(
            group="statement",
            name=one.name,
            value=getattr(statement, one.name),
            unit="-",
            decides=texts.get(one.name, ""),
            trades="See [what we believe](what_we_believe.md).",
            origin="Calibrated by `./pam check calibrate-statement`."
            if one.name in CALIBRATED
            else "Set by hand.",
            acts=DECISION,
        )
        for one in fields(statement)
    ]


def changed(path: str, value: float, rules: Rules = DEFAULT) -> Rules:
    """A copy of the rules with one value changed.

    Parameters
    ----------
    path : str
        "group.name", as in `RuleEntry.path`.
    value : float
        The new value.
    rules : Rules
        The rules that are copied.

    Raises
    ------
    PamError
        When there is no rule with that name, or a number of the statement is not above 0.
    """
    entry = next((one for one in table(rules) if one.path == path), None)
    if entry is None:
        raise PamError(unknown("constant", path, (one.path for one in table(rules))))
    if entry.group == "statement" and not (math.isfinite(value) and value > 0.0):
        raise PamError(f"{path}={value:g}: expected a number above 0")
    part: Any = getattr(rules, entry.group)
    return replace(rules, **{entry.group: replace(part, **{entry.name: value})})
