"""The table of constants as a page of the documentation."""

from __future__ import annotations

from pam_check.doc_pages.markdown import table
from pam_gap.rules.rule import DECISION, DIAGNOSIS, PROPOSAL
from pam_gap.rules.table import table as constants

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
`./pam check pages` from `pam_gap.rules`, where the code reads the values.

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


def constants_page() -> str:
    """Return the page as Markdown."""
    parts = [_HEAD]
    head = ("constant", "value", "unit", "acts on", "decides", "trades", "origin")
    for group, title in GROUPS.items():
        rows = [
            (f"`{e.path}`", f"{e.value:g}", e.unit, ACTS[e.acts], e.decides, e.trades, e.origin)
            for e in constants()
            if e.group == group
        ]
        parts.append(f"\n## {title}\n\n{table(head, rows)}\n")
    return "".join(parts)
