"""Finds the numbers of the statement of belief that drawn rigs calibrate, by maximum likelihood.

The likelihood is the probability that the posterior gives to what was hidden, over all rigs of
finished campaigns: a proper score, so that the numbers which say what is true are the best ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from pam_check.blind.score import surprise
from pam_check.blind.sensitivity import Campaign
from pam_gap.inference.posterior import posterior
from pam_gap.prediction.fit import Array
from pam_gap.rules import DEFAULT
from pam_gap.rules.statement import CALIBRATED, STATEMENT, Statement
from pam_model.command_line import Arguments, Outcome
from pam_model.errors import PamError

PULL = 0.02
"""Weight of the squared logarithms of the changes, per rig: few rigs change little."""


def believed(campaigns: Sequence[Campaign], statement: Statement) -> float:
    """Mean surprise of the statement over the rigs of all campaigns (`score.surprise`)."""
    labels = [
        label | {"case": f"{k}/{label['case']}"}
        for k, campaign in enumerate(campaigns)
        for label in campaign.labels
    ]
    rules = replace(DEFAULT, statement=statement)
    answers = {
        f"{k}/{case}": {"probabilities": posterior(evidence, rules)}
        for k, campaign in enumerate(campaigns)
        for case, evidence in campaign.evidence.items()
    }
    found = surprise(labels, answers)
    if found is None:
        raise PamError("the campaigns hold no evidence; expected at least one diagnosed rig")
    return found


def calibrated(campaigns: Sequence[Campaign], statement: Statement = STATEMENT) -> Statement:
    """The statement with the numbers `CALIBRATED` that make what is hidden most probable."""
    start = np.log([getattr(statement, name) for name in CALIBRATED])

    def of(logs: Array) -> Statement:
        return replace(statement, **dict(zip(CALIBRATED, np.exp(logs).tolist(), strict=True)))

    def objective(logs: Array) -> float:
        return believed(campaigns, of(logs)) + PULL * float(np.mean((logs - start) ** 2))

    found = minimize(
        objective, start, method="Nelder-Mead",
        options={"maxiter": 400, "xatol": 0.02, "fatol": 1e-4},
    )  # fmt: skip
    return of(found.x)


def run(given: Arguments) -> Outcome:
    """Print the calibrated numbers; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        When a folder contains no campaign with evidence.
    """
    campaigns = [Campaign.read(folder) for folder in given.folders]
    found = calibrated(campaigns)
    result: dict[str, Any] = {
        "statement": asdict(found),
        "surprise": {"before": believed(campaigns, STATEMENT), "after": believed(campaigns, found)},
        "rigs": sum(len(campaign.evidence) for campaign in campaigns),
    }
    for name in CALIBRATED:
        print(f"{name:20s} {getattr(STATEMENT, name):.3g} -> {getattr(found, name):.3g}")
    before, after = result["surprise"].values()
    print(f"surprise over {result['rigs']} rigs {before:.3f} -> {after:.3f}")
    return Outcome(result)
