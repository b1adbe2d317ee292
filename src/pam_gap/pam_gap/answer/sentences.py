"""The verdict in one sentence."""

from __future__ import annotations

from pam_gap.answer.diagnosis import Diagnosis


def _listed(names: tuple[str, ...], last: str) -> str:
    words = [name.replace("_", " ") for name in names]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """Say what was found, for people."""
    stage = diagnosis.stage
    where = f" at the {stage} stage" if stage else ""
    if diagnosis.verdict == "none":
        return (
            "No effect is needed: the rig file, re-tuned within its tolerance, explains the "
            "recording down to its noise."
        )
    if diagnosis.verdict == "not_identifiable":
        return "The recording lacks the channels that a diagnosis needs."
    if diagnosis.verdict == "unknown":
        return (
            f"Something that no effect of the table explains{where}: the best of them leaves more "
            "than it should."
        )
    closed = diagnosis.closed
    share = (
        f" With it {100 * closed.value:.0f} % of the gap closes on held-out data." if closed else ""
    )
    if diagnosis.verdict == "ambiguous":
        groups = " and ".join(_listed(group, "or") for group in diagnosis.indistinguishable)
        return f"The gap arises{where}; this recording cannot tell {groups} apart.{share}"
    return f"The cause is {_listed(diagnosis.effects, 'and')}{where}.{share}"
