"""The answer in one line: cause, size, and share of the error, in the units of the user."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import takewhile

from pam_gap.answer.diagnosis import Diagnosis, FoundParameter
from pam_gap.answer.sentences import how_much
from pam_gap.answer.user_units import percent, plain, spoken, told, user_unit
from pam_gap.inference.probabilities import NONE, UNKNOWN, cause_probabilities

LEAST_SHOWN = 0.005
"""Probability below which a cause or an explanation is listed together with the others."""


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one line, without a full stop."""
    match diagnosis.verdict:
        case "named":
            causes = " and ".join(_sized(diagnosis, effect) for effect in diagnosis.effects)
            return _explaining(diagnosis, causes)
        case "ambiguous":
            return _explaining(diagnosis, _alternatives(diagnosis))
        case "unknown":
            like = f"; it looks like {diagnosis.looks_like}" if diagnosis.looks_like else ""
            return f"No known effect explains {_error(diagnosis) or 'the gap'}{like}"
        case "none":
            error = _error(diagnosis)
            return f"The re-tuned rig file {f'is right to {error}' if error else 'is right'}"
    return "The recording does not hold enough for a diagnosis"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _explaining(diagnosis: Diagnosis, causes: str) -> str:
    amount = how_much(diagnosis)
    others = " or ".join(spoken(effect) for effect in diagnosis.at_the_end)
    beside = (
        f"; {others}, at the end of the range searched, might explain as much" if others else ""
    )
    return _capital((f"{causes}: {amount}" if amount else causes) + beside)


def _alternatives(diagnosis: Diagnosis) -> str:
    """The causes that are there in any case, then those that cannot be distinguished."""
    probable = diagnosis.cause_probabilities
    either = [
        " or ".join(
            spoken(effect) for effect in sorted(group, key=lambda one: -probable.get(one, 0.0))
        )
        for group in diagnosis.indistinguishable
    ]
    open_effects = {effect for group in diagnosis.indistinguishable for effect in group}
    sure = [_sized(diagnosis, e) for e in diagnosis.effects if e not in open_effects]
    if not sure:
        return "; ".join(either)
    is_open = all(len(group) == 1 for group in diagnosis.indistinguishable)
    more = " or ".join(either) if is_open else " and ".join(either)
    return f"{' and '.join(sure)}, {'perhaps ' if is_open else ''}with {more}"


def _error(diagnosis: Diagnosis) -> str:
    """The error of the re-tuned rig file in its worst channel; empty without any."""
    if not diagnosis.sizes:
        return ""
    size = diagnosis.sizes[0]
    share = percent(size.share)
    return f"{told(size.retuned, size.unit)} at {size.channel}, {share} of its range"


def _sized(diagnosis: Diagnosis, effect: str) -> str:
    """An effect with its first parameter, of both muscles where each has its own."""
    found = diagnosis.parameters.get(effect, {})
    name = next(iter(found), "")
    base = name.partition(".")[0]
    same = dict(takewhile(lambda item: item[0].partition(".")[0] == base, found.items()))
    return (
        f"{spoken(effect)} ({_values(base if len(same) > 1 else name, same)})"
        if same
        else (spoken(effect))
    )


def _values(name: str, found: Mapping[str, FoundParameter]) -> str:
    """Values of one parameter, such as "overlap 0.05 and 0.06" or "torque 0.52 N m"."""
    values = [entry.interval.value for entry in found.values()]
    unit, factor = user_unit(max(values, key=abs), next(iter(found.values())).unit)
    numbers = " and ".join(plain(factor * value) for value in values)
    return f"{spoken(name)} {numbers} {unit}".removesuffix(" -")


def marginals(probabilities: Mapping[str, float]) -> list[tuple[str, float]]:
    """Probability of each cause, whatever comes with it, then of `unknown` and `none`.

    Parameters
    ----------
    probabilities : mapping
        Explanation (effects joined by " + ", `unknown` or `none`) -> probability.

    Returns
    -------
    list of (str, float)
        Causes, the most probable first, without those below `LEAST_SHOWN`.
    """
    others = (UNKNOWN, NONE)
    causes = {e for name in probabilities if name not in others for e in name.split(" + ")}
    found = list(cause_probabilities(probabilities, causes).items())
    found += [(name, probabilities[name]) for name in others if name in probabilities]
    return [(name, p) for name, p in found if p >= LEAST_SHOWN]
