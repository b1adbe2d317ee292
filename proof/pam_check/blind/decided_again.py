"""Decides a finished campaign again from the evidence it kept, beside the verdicts it stored.

So it is seen which answers another statement of belief or other constants change, without any new
diagnosis. The rigs are not fresh ones for what was made after them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pam_check.blind.score import score, surprise
from pam_check.blind.sensitivity import Campaign, same
from pam_gap.rules import DEFAULT
from pam_model.command_line import Arguments, Outcome

NEED_FITS = ("closed_interval_covers", "outside_unknown_or_leftover")
"""Figures that need further fits: what an improved rig file closes, and what an answer leaves."""


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
    sides = {"before": campaign.answers, "after": answers}
    scores = {side: score(campaign.labels, given) for side, given in sides.items()}
    return {
        "changed": changed,
        "inexact": inexact,
        "counts": {
            name: {
                "of": entry["of"],
                **{
                    side: {key: found["shares"][name][key] for key in ("hits", "interval")}
                    for side, found in scores.items()
                },
            }
            for name, entry in scores["after"]["shares"].items()
            if entry["of"] and name not in NEED_FITS
        },
        "surprise": {side: surprise(campaign.labels, given) for side, given in sides.items()},
        **{
            key: [
                {"from": row["from"]}
                | {
                    side: [found[key][place]["right"][count] for count in ("hits", "of")]
                    for side, found in scores.items()
                }
                for place, row in enumerate(scores["after"][key])
            ]
            for key in ("reliability", "reliability_of_causes")
        },
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
    print(f"{len(result['changed'])} answers change; {result['inexact']} would need further fits")
    print(f"{'':28s} {'before, 90 % interval':>24s} {'after, 90 % interval':>24s}   of")
    for name, entry in result["counts"].items():
        cells = [
            f"{entry[side]['hits']} ({low:.0%} to {high:.0%})"
            for side in ("before", "after")
            for low, high in [entry[side]["interval"]]
        ]
        print(f"{name:28s} {cells[0]:>24s} {cells[1]:>24s} {entry['of']:4d}")
    for key in ("reliability", "reliability_of_causes"):
        for row in result[key]:
            told = [f"{right}/{of}" for right, of in (row["before"], row["after"])]
            print(f"{key} from {row['from']:<12.2f} {told[0]:>7s} {told[1]:>7s}")
    for side, value in result["surprise"].items():
        if value is not None:
            print(f"surprise {side} {value:.2f}")
    return Outcome(result)
