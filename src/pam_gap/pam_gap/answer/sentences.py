"""The verdict as a sentence for people: where the gap arises, what causes it, and how much."""

from __future__ import annotations

from collections.abc import Sequence

from pam_gap.answer.diagnosis import Diagnosis
from pam_model.effects import EFFECTS


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _words(effect: str) -> str:
    return effect.replace("_", " ")


def _with_stages(effects: Sequence[str]) -> str:
    """The effects, each with its own stage: those of one verdict can act at several stages."""
    return _listed([f"{_words(effect)} ({EFFECTS[effect].stage} stage)" for effect in effects])


def best_left(diagnosis: Diagnosis) -> str:
    """The error that remains with the best known effects, for a verdict of `unknown`."""
    if not diagnosis.ranking:
        return "no known effect was fitted."
    best = diagnosis.ranking[0]
    worst = max(best.over_floor, default=0.0)
    names = _listed([_words(effect) for effect in best.effects])
    subject, verb, owner = (
        ("effect", "leaves", "its law") if len(best.effects) == 1 else ("effects", "leave", "these")
    )
    return (
        f"the best known {subject} ({names}) still {verb} an RMS error of {worst:.2g} times the "
        f"noise floor in the worst channel, which is more than {owner} should leave."
    )


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences, and what makes it less certain than it looks."""
    return " ".join([_verdict(diagnosis), *(f"Caution: {c}" for c in diagnosis.cautions)])


def _verdict(diagnosis: Diagnosis) -> str:
    effects, closed = diagnosis.effects, diagnosis.closed
    if diagnosis.verdict == "none":
        ratios = [gap.after / gap.floor for gap in diagnosis.gap.values() if gap.floor > 0.0]
        left = (
            f" The largest RMS error of a channel is {max(ratios):.2g} times its noise floor."
            if ratios
            else ""
        )
        return (
            "No effect is needed: the rig file, with its parameters re-tuned within their "
            f"tolerance, explains the recording down to the noise.{left}"
        )
    if diagnosis.verdict == "not_identifiable":
        return f"A diagnosis is not possible. {' '.join(diagnosis.missing)}".rstrip()
    if diagnosis.verdict == "unknown":
        where = f" at the {diagnosis.stage} stage" if diagnosis.stage else ""
        return f"The cause of the gap{where} is unknown: {best_left(diagnosis)}"
    share = f"{100 * closed.value:.0f} % of the gap on held-out data." if closed else ""
    if diagnosis.verdict == "ambiguous":
        open_effects = {effect for group in diagnosis.indistinguishable for effect in group}
        sure = [effect for effect in effects if effect not in open_effects]
        groups = ", or between ".join(map(_with_stages, diagnosis.indistinguishable))
        also = f" A further cause is {_with_stages(sure)}." if sure else ""
        best = f" The best hypothesis closes {share}" if share else ""
        return (
            "The gap has a known cause, but this recording cannot distinguish between "
            f"{groups}.{also}{best}"
        )
    if len(effects) == 1:
        modelled = f" Modelling it closes {share}" if share else ""
        return f"The cause is {_words(effects[0])} at the {diagnosis.stage} stage.{modelled}"
    modelled = f" Modelling them closes {share}" if share else ""
    return f"The causes are {_with_stages(effects)}.{modelled}"
