"""Decides a finished campaign again with the rules of this version, from the evidence it kept.

So it is seen which answers a new rule changes, without any new diagnosis. The rigs are not fresh
ones for a rule that was made after them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pam_check.blind.score import score
from pam_check.blind.sensitivity import Campaign, same
from pam_gap.rules import DEFAULT
from pam_model.command_line import Arguments, Outcome


def _told(answer: Mapping[str, Any]) -> str:
    return " ".join([str(answer["verdict"]), ", ".join(answer["effects"])]).strip()


def decided_again(campaign: Campaign) -> dict[str, Any]:
    """The answers that change, and the figures of the blind check before and after.

    Parameters
    ----------
    campaign : Campaign
        A finished campaign with the evidence of every case.
    """
    answers, inexact = campaign.decided(DEFAULT)
    before = score(campaign.labels, campaign.answers)["shares"]
    after = score(campaign.labels, answers)["shares"]
    labels = {str(label["case"]): label for label in campaign.labels}
    changed = [
        {
            "case": case,
            "hidden": labels[case]["effects"],
            "before": _told(campaign.answers[case]),
            "after": _told(answer),
        }
        for case, answer in answers.items()
        if not same(answer, campaign.answers[case])
    ]
    counted = {
        name: {"before": before[name]["hits"], "after": entry["hits"], "of": entry["of"]}
        for name, entry in after.items()
    }
    return {"changed": changed, "counts": counted, "inexact": inexact}


def run(given: Arguments) -> Outcome:
    """Print what changes; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        When the folder contains no campaign with evidence.
    """
    result = decided_again(Campaign.read(given.folder))
    for entry in result["changed"]:
        hidden = " + ".join(entry["hidden"]) or "nothing"
        print(f"{entry['case']}: {hidden} hidden; {entry['before']} -> {entry['after']}")
    for name, entry in result["counts"].items():
        if entry["before"] != entry["after"]:
            print(f"{name:28s} {entry['before']} -> {entry['after']} of {entry['of']}")
    print(f"{len(result['changed'])} answers change")
    return Outcome(result)
