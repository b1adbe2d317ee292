"""`pam check rules`: the table of constants as a page of the documentation."""

from __future__ import annotations

from pam_gap.rules.rule import DECISION, DIAGNOSIS, PROPOSAL
from pam_gap.rules.table import table
from pam_model.command_line import Arguments, Outcome

PAGE = "constants_of_the_diagnosis.md"
GROUPS = {
    "statement": "Statement of belief",
    "recording": "Noise of the channels",
    "prediction": "Prediction and fit",
    "search": "Search and held-out scores",
    "decision": "Background, what matters, and intervals",
    "experiment": "Next experiment",
    "fleet": "Many recordings over time",
}
ACTS = {
    DECISION: "decision",
    DIAGNOSIS: "diagnosis",
    PROPOSAL: "no verdict",
}
_HEAD = """# Constants of the diagnosis

This page lists every constant that can change an answer of the diagnosis. It is written by
`./pam check rules` from `pam_gap.rules`, where the code reads the values.

*Acts on* names the first step that a change of the constant affects:

- *decision*: the verdict can be decided again from the evidence that a diagnosis keeps;
- *diagnosis*: the recording must be diagnosed again;
- *no verdict*: only notes, figures, the next experiment or what is
  followed over time change.

*Decides* gives the meaning of the value. *Trades* says what happens when the value is made larger
or smaller.

A *level* is the sum over channels of log (mean squared error / noise floor) on held-out data. A
difference of levels is twice the log likelihood ratio per observation of two Gaussian models. A
fall of the level by 1 in one channel divides its RMS error by 1.65. *RMS over floor* is the RMS
error divided by the RMS value of the noise floor.

How each constant affects a check on withheld rigs is shown in the
[table of changes](how_often_right.md#how-much-the-verdicts-depend-on-the-constants).
"""


def to_markdown() -> str:
    """Return the page as Markdown."""
    parts = [_HEAD]
    for group, title in GROUPS.items():
        parts.append(
            f"\n## {title}\n\n"
            "| constant | value | unit | acts on | decides | trades | origin |\n"
            "|---|---|---|---|---|---|---|\n"
        )
        parts += [
            f"| `{e.path}` | {e.value:g} | {e.unit} | {ACTS[e.acts]} | {e.decides} | {e.trades} | "
            f"{e.origin} |\n"
            for e in table()
            if e.group == group
        ]
    return "".join(parts)


def run(given: Arguments) -> Outcome:
    """Write the page; the command of `pam_gap.__main__`."""
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / PAGE
    path.write_text(to_markdown(), encoding="utf-8")
    print(f"written: {path}")
    return Outcome({"page": str(path), "constants": len(table())})
