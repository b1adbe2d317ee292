"""Sensitivity of the verdicts to the hand-set constants: each is made smaller and larger.

If a constant acts after the search, the verdicts are decided again from the evidence that every
diagnosis of a campaign kept (`blind --keep-evidence`), which takes milliseconds. If a constant acts
earlier, the recordings have to be diagnosed again, which is done for a given number of cases. First
the decisions are repeated with the constants in use; they must give the stored verdicts.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pam_check.blind.cases import LABELS
from pam_check.blind.score import score
from pam_check.blind.untouched import with_untouched
from pam_gap.diagnosis_files import EVIDENCE, diagnose_files
from pam_gap.inference.decide import decide, decided_answer
from pam_gap.inference.evidence import Evidence, load_evidence
from pam_gap.inference.score import Score
from pam_gap.rules import DEFAULT, RuleEntry, Rules, changed, table
from pam_gap.rules.rule import DECISION, PROPOSAL
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.errors import PamError
from pam_model.names import unknown

CHANGE = 0.3
"""Default relative change of each constant, downwards and upwards."""
COUNTED = (
    "top1",
    "truth_in_set",
    "stage",
    "false_name_on_clean",
    "unknown_recall",
    "false_unknown",
    "both_of_two",
    "one_of_two",
    "closed_interval_covers",
)
HEADINGS = (
    "named first",
    "in the set",
    "stage",
    "false name",
    "`unknown` found",
    "false `unknown`",
    "both of two",
    "one of two",
    "interval covers",
)

COLUMNS = ("constant", "in use", "changed to", "how", "cases", "verdicts moved")

Answers = Mapping[str, Mapping[str, Any]]
SAME = ("verdict", "stage", "effects", "indistinguishable")


@dataclass(frozen=True, slots=True)
class Campaign:
    """A finished campaign whose diagnoses kept their evidence."""

    folder: Path  # folder of the campaign
    labels: list[dict[str, Any]]  # hidden effects of each case
    answers: Answers  # case -> diagnosis.json
    evidence: Mapping[str, Evidence[Score]]  # case -> evidence that its diagnosis kept

    @classmethod
    def read(cls, folder: Path) -> Campaign:
        """Read a campaign, labels included.

        Raises
        ------
        PamError
            When the folder contains no finished campaign, a case has no evidence, or the labels
            are not the sealed ones.
        """
        labels_file, score_file = folder / "sealed" / LABELS, folder / "score.json"
        if not labels_file.exists() or not score_file.exists():
            raise PamError(
                f"{folder}: no finished campaign; expected the --out folder of "
                "`blind --keep-evidence`"
            )
        text = labels_file.read_text()
        sealed = json.loads(score_file.read_text())["labels_sha256"]
        if hashlib.sha256(text.encode()).hexdigest() != sealed:
            raise PamError(f"{labels_file}: not the labels that were sealed for {score_file}")
        answers, evidence = {}, {}
        for label in json.loads(text):
            place = folder / "answers" / label["case"]
            if not (place / "diagnosis.json").exists():
                continue  # a crash counts as wrong with any constants
            if not (place / EVIDENCE).exists():
                raise PamError(
                    f"{place}: no {EVIDENCE}; run the campaign again with --keep-evidence"
                )
            answers[label["case"]] = json.loads((place / "diagnosis.json").read_text())
            evidence[label["case"]] = load_evidence(place / EVIDENCE)
        stored = json.loads(score_file.read_text()).get("untouched", {})
        for case, share in stored.items():
            if answers.get(case, {}).get("closed"):
                answers[case]["closed"]["untouched"] = share
        return cls(folder, json.loads(text), answers, evidence)

    def decided(self, rules: Rules) -> tuple[dict[str, dict[str, Any]], int]:
        """Decide every verdict again; return the answers and the number of inexact cases."""
        answers: dict[str, dict[str, Any]] = {}
        inexact = 0
        for case, kept in self.evidence.items():
            again = decide(kept, rules)
            answers[case] = decided_answer(kept, again, rules)
            inexact += not again.is_exact
            before = self.answers[case]
            # Measured with the identified rig, so it is valid only if the same effects are found.
            share = (before.get("closed") or {}).get("untouched")
            if share is not None and answers[case]["closed"] and same(answers[case], before):
                answers[case]["closed"] = answers[case]["closed"] | {"untouched": share}
        return answers, inexact

    def check(self) -> None:
        """Repeat every decision with the constants in use.

        Raises
        ------
        PamError
            When a verdict differs from the stored one, so that the evidence cannot be used.
        """
        answers, _ = self.decided(DEFAULT)
        off = [case for case, answer in answers.items() if not same(answer, self.answers[case])]
        if off:
            raise PamError(
                f"{self.folder}: with the constants in use, the kept evidence gives other verdicts "
                f"for {', '.join(off)}; the campaign was made with other constants or versions"
            )


@dataclass(frozen=True, slots=True)
class SensitivityRow:
    """Result of one change of one constant."""

    entry: RuleEntry  # the constant
    value: float  # its value after the change
    how: str  # "decided again", "diagnosed again", "changes no verdict" or "not run"
    cases: int = 0  # number of cases
    # score -> (hits, cases), as the blind check counts them
    counts: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    # the same counts with the constants in use, for the same cases
    before: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    moved: int = 0  # number of cases whose verdict, stage, effects or sets differ
    inexact: int = 0  # number of cases in which the new decision would need a fit that was not made


def same(first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    """Whether two answers have the same verdict, stage, effects and sets."""
    return all(first[key] == second[key] for key in SAME)


def counts_of(labels: Sequence[Mapping[str, Any]], answers: Answers) -> dict[str, tuple[int, int]]:
    """The counts of the blind check."""
    shares = score(labels, answers)["shares"]
    return {name: (shares[name]["hits"], shares[name]["of"]) for name in COUNTED}


def diagnosed_again(task: tuple[Path, str, Rules, Path]) -> dict[str, Any]:
    """Diagnose one case again with other rules, and score its rig on the second recording."""
    folder, case, rules, out = task
    place = folder / "cases" / case
    found = diagnose_files(
        [place / "recording.csv.gz"],
        place / "rig.yaml",
        out,
        threads=1,
        show_progress=False,
        rules=rules,
    )
    return with_untouched(found[0].to_json(), folder, case, out)


def sensitivity(
    campaign: Campaign,
    *,
    change: float = CHANGE,
    rediagnose: int = 0,
    workers: int = 1,
    only: Sequence[str] = (),
    tell: Callable[[SensitivityRow], None] = lambda row: None,
) -> list[SensitivityRow]:
    """Change every constant downwards and upwards by a given share.

    Parameters
    ----------
    campaign : Campaign
        A campaign with evidence.
    change : float
        Relative change of a constant.
    rediagnose : int
        Number of cases that are diagnosed again for constants that act before the decision.
    workers : int
        Number of parallel diagnoses.
    only : sequence of str
        Constants ("group.name") to change; empty means all.
    tell : callable
        Called with every row as soon as it is known.

    Raises
    ------
    PamError
        When the evidence does not give the stored verdicts, or a constant does not exist.
    """
    campaign.check()
    known = {entry.path: entry for entry in table()}
    for path in only:
        if path not in known:
            raise PamError(unknown("constant", path, known))
    entries = [known[path] for path in only] if only else list(known.values())
    rows = []
    for entry in entries:
        for factor in (1.0 - change, 1.0 + change):
            value = entry.scaled(factor)
            rules = changed(entry.path, value)
            if entry.acts == PROPOSAL:
                row = SensitivityRow(entry, value, "changes no verdict")
            elif entry.acts == DECISION:
                answers, inexact = campaign.decided(rules)
                row = _row(campaign, entry, value, "decided again", answers, inexact)
            elif rediagnose > 0:
                cases = sorted(campaign.answers)[:rediagnose]
                out = campaign.folder / "sensitivity" / f"{entry.path}_{factor:g}"
                tasks = [(campaign.folder, case, rules, out / case) for case in cases]
                with ProcessPoolExecutor(workers) as pool:
                    found = dict(zip(cases, pool.map(diagnosed_again, tasks), strict=True))
                row = _row(campaign, entry, value, "diagnosed again", found)
            else:
                row = SensitivityRow(entry, value, "not run")
            rows.append(row)
            tell(row)
    return rows


def _row(
    campaign: Campaign,
    entry: RuleEntry,
    value: float,
    how: str,
    answers: Answers,
    inexact: int = 0,
) -> SensitivityRow:
    labels = [label for label in campaign.labels if label["case"] in answers]
    before = {case: campaign.answers[case] for case in answers}
    moved = sum(not same(answers[case], before[case]) for case in answers)
    return SensitivityRow(
        entry,
        value,
        how,
        len(answers),
        counts_of(labels, answers),
        counts_of(labels, before),
        moved,
        inexact,
    )


def to_json(rows: Sequence[SensitivityRow]) -> list[dict[str, Any]]:
    """The rows as data for a JSON file."""
    return [
        {
            "constant": row.entry.path,
            "in_use": row.entry.value,
            "changed_to": row.value,
            "how": row.how,
            "cases": row.cases,
            "verdicts_moved": row.moved,
            "inexact": row.inexact,
            "counts": {name: list(pair) for name, pair in row.counts.items()},
            "before": {name: list(pair) for name, pair in row.before.items()},
        }
        for row in rows
    ]


def _cell(after: tuple[int, int], before: tuple[int, int]) -> str:
    """One count as text; a dot if it did not change."""
    if after == before:
        return "·"
    return f"{after[0]}/{after[1]} (was {before[0]}/{before[1]})"


def to_markdown(rows: Sequence[SensitivityRow]) -> str:
    """Table of the changes that moved a verdict or a count, and lists of the other constants."""
    lines = [
        "| " + " | ".join((*COLUMNS, *HEADINGS)) + " |",
        "|---" * (len(COLUMNS) + len(HEADINGS)) + "|",
    ]
    moving = [row for row in rows if row.moved or row.counts != row.before]
    for row in moving:
        inexact = f" ({row.inexact} not exact)" if row.inexact else ""
        cells = [_cell(row.counts[name], row.before[name]) for name in COUNTED]
        lines.append(
            f"| `{row.entry.path}` | {row.entry.value:g} | {row.value:.4g} | {row.how} | "
            f"{row.cases} | {row.moved}{inexact} | " + " | ".join(cells) + " |"
        )
    paths = {row.entry.path for row in moving}
    still = [row for row in rows if row.entry.path not in paths]
    for title, how in (
        ("Decided again, and no verdict or count moved", "decided again"),
        ("Diagnosed again, and no verdict or count moved", "diagnosed again"),
        ("Not run", "not run"),
        ("Changes no verdict", "changes no verdict"),
    ):
        names = dict.fromkeys(f"`{row.entry.path}`" for row in still if row.how == how)
        if names:
            lines += ["", f"{title}: {', '.join(names)}."]
    return "\n".join(lines) + "\n"


def run(given: Arguments) -> Outcome:
    """Write the sensitivity table of a campaign; the command of `pam_check.__main__`.

    Writes `sensitivity.md` and `sensitivity.json` into the campaign's folder.

    Raises
    ------
    PamError
        When the folder contains no campaign with evidence, or evidence of another version.
    """
    campaign = Campaign.read(given.folder)
    rows: list[SensitivityRow] = []
    total = 2 * (len(given.only) or len(table()))
    with progress(total, "changing constants") as bar:

        def tell(row: SensitivityRow) -> None:
            rows.append(row)
            bar.show(len(rows))

        sensitivity(
            campaign,
            change=given.percent / 100.0,
            rediagnose=given.rediagnose,
            workers=given.workers,
            only=given.only,
            tell=tell,
        )
    document = to_json(rows)
    (given.folder / "sensitivity.json").write_text(json.dumps(document, indent=1) + "\n")
    (given.folder / "sensitivity.md").write_text(to_markdown(rows))
    print(f"{len(campaign.answers)} cases; the kept evidence gives every stored verdict again")
    for how in ("decided again", "diagnosed again", "not run", "changes no verdict"):
        print(f"{how}: {len({row.entry.path for row in rows if row.how == how})} constants")
    print(f"written: {given.folder / 'sensitivity.md'}, {given.folder / 'sensitivity.json'}")
    return Outcome(document)
