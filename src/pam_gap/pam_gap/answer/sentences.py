"""The verdict as a sentence for people: where the gap arises, what causes it, and how much."""

from __future__ import annotations

from collections.abc import Sequence

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.user_units import (
    as_probability,
    interval_digits,
    percent,
    plain,
    spoken,
    told,
    user_unit,
)
from pam_gap.inference.held_out import OTHER_LENGTHS
from pam_gap.prediction.materiality import GapSize
from pam_model.effects import EFFECTS

type SizesAtTheEnd = Sequence[tuple[str, str, float, str]]
"""Effect, parameter, value and unit of sizes at the far end of the range that is searched."""
MOST_RIVALS = 2
"""Of explanations at the end of their range that are told."""
MOST_PARAMETERS = 3
"""Of an effect, in a sentence; the table of the report has all of them."""
LIKELY = 0.5
"""Probability below which a cause is more likely wrong than right."""
_DOUBTFUL = "The most probable of several causes"
VISIBLE = 0.66
"""Error without noise, over the floor, from which a gap can be seen (1.2 floors with noise)."""


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _with_stages(diagnosis: Diagnosis, effects: Sequence[str]) -> str:
    """The effects, each with its stage and, where it is known, its probability."""
    probable = diagnosis.cause_probabilities
    return _listed(
        [
            f"{spoken(effect)} ({EFFECTS[effect].stage} stage"
            + (f", {as_probability(probable[effect])})" if effect in probable else ")")
            for effect in effects
        ]
    )


def best_left(diagnosis: Diagnosis) -> str:
    """The error that remains with the best known effects, for a verdict of `unknown`."""
    if not diagnosis.ranking:
        return "no known effect was fitted."
    best = diagnosis.ranking[0]
    worst = max(best.over_floor, default=0.0)
    names = _listed([spoken(effect) for effect in best.effects])
    if diagnosis.looks_like:
        return (
            f"it looks like {diagnosis.looks_like}, which is no effect of the table but explains "
            f"more than the best of the table ({names})."
        )
    subject, verb, owner = (
        ("effect", "leaves", "its law") if len(best.effects) == 1 else ("effects", "leave", "these")
    )
    return (
        f"the best known {subject} ({names}) still {verb} an RMS error of {plain(worst, 2)} times "
        f"the noise floor in the worst channel, which is more than {owner} should leave."
    )


def with_parameters(diagnosis: Diagnosis, effect: str) -> str:
    """The parameters of an effect with their intervals, such as "torque 1.1 N m (1 to 1.2)"."""
    shown = []
    for name, found in list(diagnosis.parameters.get(effect, {}).items())[:MOST_PARAMETERS]:
        value, low, high = found.interval.value, found.interval.low, found.interval.high
        unit, factor = user_unit(value, found.unit)
        digits = interval_digits(factor * low, factor * high)
        ends = " to ".join(plain(factor * end, digits) for end in (low, high))
        number = f"{plain(factor * value, digits)} {unit}".removesuffix(" -")
        shown.append(f"{spoken(name)} {number} ({ends})")
    return ", ".join(shown)


def headline_size(diagnosis: Diagnosis) -> GapSize | None:
    """The channel in which the rig file as written is wrong by the largest share of the motion."""
    return max(diagnosis.sizes, key=lambda s: s.before / max(s.motion, 1e-300), default=None)


def how_much(diagnosis: Diagnosis) -> str:
    """What the named causes explain, in the units of the channel with the largest gap."""
    size = headline_size(diagnosis)
    if size is None or size.before <= 0.0:
        return ""
    error = f"{told(size.before, size.unit)} at {size.channel}"
    where = " at lengths that were not fitted" if diagnosis.withheld == OTHER_LENGTHS else ""
    return f"{percent(size.explained)} of an error of {error}{where}"


def what_is_left(diagnosis: Diagnosis) -> str:
    """What the answer leaves, if it matters: its size, channel, and share of the motion."""
    material = [size for size in diagnosis.sizes if size.leaves_material]
    if not material:
        return ""
    size = max(material, key=lambda s: s.share_left)
    usual = ", no more than ordinary imperfections of a good rig leave"
    return (
        f"{told(size.after, size.unit)} at {size.channel} remain unexplained, "
        f"{percent(size.share_left)} of its range{usual if size.leaves_ordinary else ''}."
    )


def _ordinary(diagnosis: Diagnosis) -> str:
    """The effects that are no larger than on an ordinary good rig; empty without any."""
    if not diagnosis.ordinary:
        return ""
    names = _listed([spoken(effect) for effect in diagnosis.ordinary])
    return f" The recording also shows {names} of a size that every good rig has."


def nothing_material(diagnosis: Diagnosis) -> str:
    """The verdict `none` for a gap above the noise that is too small to matter."""
    size = diagnosis.sizes[0]
    if size.retuned > size.limit and size.background > 0.0:
        usual = told(size.background, size.unit)
        compared = (
            f"This is no more than the {usual} that the small imperfections of a good rig can leave"
            if size.retuned <= size.background
            else f"The small imperfections of a good rig leave {usual} or somewhat more"
        )
        return (
            "Ordinary imperfections: the rig file, re-tuned within its tolerance, is wrong by "
            f"{told(size.retuned, size.unit)} at {size.channel}, {percent(size.share)} of its "
            f"range of {told(size.motion, size.unit, 3)}. {compared}, and no effect exceeds them "
            f"clearly.{_ordinary(diagnosis)}"
        )
    limit, reason = size.limit, "This is"
    if size.is_material:
        limit, reason = size.limit_unexplained, "No known effect explains this, and it is"
    share = limit / max(size.motion, 1e-300)
    return (
        "The gap is too small to need a cause: the rig file, re-tuned within its tolerance, is "
        f"wrong by {told(size.retuned, size.unit)} at {size.channel}, {percent(size.share)} of its "
        f"range of {told(size.motion, size.unit, 3)}. {reason} below the limit of {percent(share)} "
        f"({told(limit, size.unit)})."
    )


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences, and what makes it less certain than it looks."""
    return " ".join([_verdict(diagnosis), *(f"Caution: {c}" for c in diagnosis.cautions)])


def _verdict(diagnosis: Diagnosis) -> str:
    match diagnosis.verdict:
        case "none":
            return _nothing(diagnosis)
        case "not_identifiable":
            return f"A diagnosis is not possible. {' '.join(diagnosis.missing)}".rstrip()
        case "unknown":
            where = f" at the {diagnosis.stage} stage" if diagnosis.stage else ""
            amount = _unknown_size(diagnosis)
            return f"The cause of the gap{where} is unknown: {amount}{best_left(diagnosis)}"
        case "ambiguous":
            return _ambiguous(diagnosis)
    return _named(diagnosis)


def sizes_at_the_end(found: SizesAtTheEnd) -> tuple[str, ...]:
    """A caution for each named effect with sizes at the far end of the range that is searched.

    Parameters
    ----------
    found : sequence of tuple
        Effect, parameter, value and unit of each such size.
    """
    sizes: dict[str, list[str]] = {}
    for effect, name, value, unit in found:
        sizes.setdefault(effect, []).append(f"{spoken(name)} {told(value, unit)}".rstrip())
    return tuple(
        f"The size found for {spoken(effect)} ({', '.join(values)}) is at the end of the range "
        "that is searched. If the effect cannot be so large on your rig, the cause is another one."
        for effect, values in sizes.items()
    )


def effects_at_the_end(rivals: Sequence[SizesAtTheEnd]) -> tuple[str, ...]:
    """The effects of these explanations, each once, the one that explains most first."""
    return tuple(dict.fromkeys(effect for one in rivals for effect, *_ in one))[:MOST_RIVALS]


def rivals_at_the_end(rivals: Sequence[SizesAtTheEnd]) -> tuple[str, ...]:
    """A caution for other explanations whose sizes are at the end of the range searched.

    Parameters
    ----------
    rivals : sequence of sequence of tuple
        For each of them, the one that explains most first, the sizes as in `sizes_at_the_end`.
    """
    told_sizes = [
        f"{spoken(effect)} ({spoken(name)} {told(value, unit)}".rstrip() + ")"
        for effect, name, value, unit in dict.fromkeys(size for one in rivals for size in one)
    ][:MOST_RIVALS]
    if not told_sizes:
        return ()
    return (
        f"Explanations with {_listed(told_sizes)} also remove most of the gap, and end at the end "
        "of the range that is searched. With more of it they might explain as much, which "
        "lowers the probability of the others.",
    )


def _unknown_size(diagnosis: Diagnosis) -> str:
    """The size of a gap that is not explained, before what comes closest."""
    if not diagnosis.sizes:
        return ""
    size = diagnosis.sizes[0]
    closest = ""
    if diagnosis.ranking:
        explained = min(max(1.0 - diagnosis.ranking[0].remaining.value, 0.0), 1.0)
        closest = f"the closest explanation removes {percent(explained)} of the gap; "
    return (
        f"the rig file, re-tuned within its tolerance, is wrong by {told(size.retuned, size.unit)} "
        f"at {size.channel}, {percent(size.share)} of its range; {closest}"
    )


def _nothing(diagnosis: Diagnosis) -> str:
    if any(size.retuned > VISIBLE * size.floor for size in diagnosis.sizes):
        return nothing_material(diagnosis)
    ratios = [gap.after / gap.floor for gap in diagnosis.gap.values() if gap.floor > 0.0]
    left = (
        f" The largest RMS error of a channel is {plain(max(ratios), 2)} times its noise floor."
        if ratios
        else ""
    )
    return (
        "No effect is needed: the rig file, with its parameters re-tuned within their "
        f"tolerance, explains the recording down to the noise.{left}"
    )


def _closes(diagnosis: Diagnosis, subject: str) -> str:
    """What the answer explains, and what it leaves if that matters; empty without any figure."""
    amount = how_much(diagnosis)
    if amount:
        return f" {subject} {amount}. {what_is_left(diagnosis)}".rstrip()
    if diagnosis.closed is None:
        return ""
    return f" {subject} {100 * diagnosis.closed.value:.0f} % of the gap on held-out data."


def _ambiguous(diagnosis: Diagnosis) -> str:
    open_effects = {effect for group in diagnosis.indistinguishable for effect in group}
    sure = [effect for effect in diagnosis.effects if effect not in open_effects]
    closes = _closes(diagnosis, "The best hypothesis explains")
    subject = "The cause is" if len(sure) == 1 else "The causes are"
    if sure and all(len(group) == 1 for group in diagnosis.indistinguishable):
        more = _with_stages(diagnosis, sorted(open_effects, key=diagnosis.effects.index))
        return (
            f"{subject} {_with_stages(diagnosis, sure)}. What this recording does not show is "
            f"whether there is a further one: {more}.{closes}"
        )
    groups = ", or between ".join(
        _with_stages(diagnosis, group) for group in diagnosis.indistinguishable
    )
    if sure:
        return (
            f"{subject} {_with_stages(diagnosis, sure)}, and a further one, for which this "
            f"recording cannot distinguish between {groups}.{closes}"
        )
    return (
        "The gap has a known cause, but this recording cannot distinguish between "
        f"{groups}.{closes}"
    )


def _named(diagnosis: Diagnosis) -> str:
    effects = diagnosis.effects
    if len(effects) == 1:
        numbers = with_parameters(diagnosis, effects[0])
        size = f": {numbers}" if numbers else ""
        probability = diagnosis.cause_probabilities.get(effects[0])
        likely = (
            "" if probability is None else f", with a probability of {as_probability(probability)}"
        )
        subject = "The cause" if probability is None or probability >= LIKELY else _DOUBTFUL
        return (
            f"{subject} is {spoken(effects[0])} at the {diagnosis.stage} stage{likely}{size}."
            f"{_closes(diagnosis, 'It explains')}{_ordinary(diagnosis)}"
        )
    numbers = "; ".join(
        f"{spoken(effect)}: {text}"
        for effect in effects
        if (text := with_parameters(diagnosis, effect))
    )
    size = f" ({numbers})" if numbers else ""
    return (
        f"The causes are {_with_stages(diagnosis, effects)}{size}."
        f"{_closes(diagnosis, 'They explain')}{_ordinary(diagnosis)}"
    )
