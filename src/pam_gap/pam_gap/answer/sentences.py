"""The verdict in one sentence."""

from __future__ import annotations

from pam_gap.answer.diagnosis import Diagnosis


def _listed(names: tuple[str, ...], last: str) -> str:
    words = [name.replace("_", " ") for name in names]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def best_left(diagnosis: Diagnosis) -> str:
    """What the best known effect leaves, for a verdict of `unknown`."""
    if not diagnosis.ranking:
        return "no known effect was tried."
    best = diagnosis.ranking[0]
    worst = max(best.over_floor, default=0.0)
    return (
        f"the best known effect ({_listed(best.effects, 'with')}) still leaves an error of "
        f"{worst:.2g} times the noise floor, which is more than its law should leave."
    )


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """Say what was found, for people."""
    stage = diagnosis.stage
    where = f" at the {stage} stage" if stage else ""
    if diagnosis.verdict == "none":
        return (
            "No effect is needed: the rig file, with its parameters re-tuned within their "
            "tolerance, explains the recording down to the noise."
        )
    if diagnosis.verdict == "not_identifiable":
        return "The recording lacks channels that a diagnosis needs."
    if diagnosis.verdict == "unknown":
        return f"Cause unknown{where}: {best_left(diagnosis)}"
    closed = diagnosis.closed
    share = f" It closes {100 * closed.value:.0f} % of the gap on held-out data." if closed else ""
    if diagnosis.verdict == "ambiguous":
        groups = "; nor between ".join(
            _listed(group, "and") for group in diagnosis.indistinguishable
        )
        return (
            f"The gap arises{where}, but this recording cannot distinguish between {groups}.{share}"
        )
    return f"The cause is {_listed(diagnosis.effects, 'and')}{where}.{share}"
