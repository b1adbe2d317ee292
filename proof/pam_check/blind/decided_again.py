"""Decides a finished campaign again from the evidence it kept: with the rules, and by belief.

So it is seen which answers a new rule changes, without any new diagnosis. The rigs are not fresh
ones for a rule that was made after them. Next to the rules stand the answers of the statement of
belief (`pam_check.blind.statement`), which does not decide in the product.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pam_check.blind.posterior import believed_answer
from pam_check.blind.score import score, surprise
from pam_check.blind.sensitivity import Answers, Campaign, same
from pam_check.blind.statement import STATEMENT
from pam_gap.rules import DEFAULT
from pam_model.command_line import Arguments, Outcome

NEED_FITS = ("closed_interval_covers", "outside_unknown_or_leftover")


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
    believed = {case: believed_answer(e, STATEMENT) for case, e in campaign.evidence.items()}
    return {
        "changed": changed,
        "counts": counted,
        "inexact": inexact,
        "rules_and_belief": side_by_side(campaign.labels, answers, believed),
    }


def side_by_side(
    labels: Sequence[Mapping[str, Any]], rules: Answers, belief: Answers
) -> dict[str, Any]:
    """Figures of the blind check for the answers of the rules and of the statement of belief.

    Left out are the figures that need further fits (what an improved rig file closes, and what an
    answer leaves).

    Parameters
    ----------
    labels : sequence of mapping
        Hidden effects of each case.
    rules, belief : mapping
        Case -> answer.
    """
    scores = [score(labels, answers) for answers in (rules, belief)]
    counts = {
        name: {"rules": entry["hits"], "belief": scores[1]["shares"][name]["hits"],
               "of": entry["of"], "interval": entry["interval"],
               "interval_of_belief": scores[1]["shares"][name]["interval"]}
        for name, entry in scores[0]["shares"].items()
        if entry["of"] and name not in NEED_FITS
    }  # fmt: skip
    reliability = {
        key: [
            {"from": first["from"], "rules": [first["right"]["hits"], first["right"]["of"]],
             "belief": [second["right"]["hits"], second["right"]["of"]]}
            for first, second in zip(scores[0][key], scores[1][key], strict=True)
        ]
        for key in ("reliability", "reliability_of_causes")
    }  # fmt: skip
    differ = [
        {"case": case, "hidden": list(label["effects"]), "rules": _told(rules[case]),
         "belief": _told(belief[case])}
        for label in labels
        if _told(rules[case := str(label["case"])]) != _told(belief[case])
    ]  # fmt: skip
    return {
        "counts": counts,
        "differ": differ,
        "surprise": {
            name: surprise(labels, answers)
            for name, answers in (("rules", rules), ("belief", belief))
        },
        **reliability,
    }


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
    both = result["rules_and_belief"]
    for entry in both["differ"]:
        hidden = " + ".join(entry["hidden"]) or "nothing"
        print(f"{entry['case']}: {hidden} hidden; rules {entry['rules']}; belief {entry['belief']}")
    print(f"{'':28s} {'rules, 90 % interval':>24s} {'belief, 90 % interval':>24s}   of")
    for name, entry in both["counts"].items():
        cells = [
            f"{entry[who]} ({low:.0%} to {high:.0%})"
            for who, (low, high) in (
                ("rules", entry["interval"]), ("belief", entry["interval_of_belief"])
            )
        ]  # fmt: skip
        print(f"{name:28s} {cells[0]:>24s} {cells[1]:>24s} {entry['of']:4d}")
    for key in ("reliability", "reliability_of_causes"):
        for row in both[key]:
            told = [f"{right}/{of}" for right, of in (row["rules"], row["belief"])]
            print(f"{key} from {row['from']:<12.2f} {told[0]:>7s} {told[1]:>7s}")
    for name, value in both["surprise"].items():
        if value is not None:
            print(f"surprise of the {name} {value:.2f}")
    return Outcome(result)
