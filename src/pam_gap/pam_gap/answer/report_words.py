"""Sentences of the report page: what to see in each figure, and what is closed and left."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from pam_gap.answer.traces import Trace, short_name
from pam_gap.answer.user_units import percent, plain, spoken, told


def closed_words(closed: Mapping[str, float] | None) -> str:
    """How much of the gap the improved rig file closes; empty without one."""
    if not closed:
        return ""
    low, high = (max(100.0 * closed[key], 0.0) for key in ("low", "high"))
    return (
        f"The improved rig file closes {max(100.0 * closed['value'], 0.0):.0f} % of the gap of all "
        "channels together, on data that were not used for the fit (90 % interval "
        f"{low:.0f} to {high:.0f} %)."
    )


def stage_words(blamed: Collection[str], verdict: str) -> str:
    """What the coloured stages are."""
    if not blamed:
        return "No stage is coloured, because none is to blame."
    if len(blamed) > 1:
        possible = "possible causes" if verdict == "ambiguous" else "causes"
        return f"The coloured stages are those of the {possible}; errors of the others can follow."
    why = "the largest gap over its noise" if verdict == "unknown" else "the cause"
    return f"The coloured stage is that of {why}; errors of the others can come from it."


def delay_words(delays: Mapping[str, float]) -> str:
    """How late the channels are [s]; empty without any."""
    if not delays:
        return ""
    late = "; ".join(f"{name} {_delay(delay)}" for name, delay in delays.items())
    return f"{late}, against the re-tuned rig file; friction and lag shift signals too"


def _delay(seconds: float) -> str:
    """A delay in words; what rounds to nothing is not called late or early."""
    shown = round(1e3 * seconds, 1)
    if shown == 0.0:
        return "by less than 0.05 ms"
    return f"{plain(shown)} ms late" if shown > 0.0 else f"{plain(-shown)} ms early"


def ranking_words(ranking: Sequence[Mapping[str, Any]]) -> str:
    """What the first two candidates leave."""
    left = [(spoken(entry["label"]), entry["remaining"]["value"]) for entry in ranking[:2]]
    told_names = [f"{name} leaves {percent(max(share, 0.0))} of the gap" for name, share in left]
    lead = told_names[0][:1].upper() + told_names[0][1:]
    return (
        f"{lead}; the next candidate, {told_names[1].replace(' leaves', ', leaves', 1)}."
        if len(told_names) > 1
        else f"{lead}."
    )


def shrinkage_words(gap: Mapping[str, Mapping[str, Any]], answer: str) -> str:
    """Where most is left, over the noise."""

    def ratio(channel: str, key: str) -> float:
        return float(gap[channel][key]) / max(float(gap[channel]["floor"]), 1e-300)

    most = max(gap, key=lambda channel: ratio(channel, "after"))
    before, after = (plain(ratio(most, key), 2) for key in ("before", "after"))
    return (
        f"The error is largest at {most}: {before} times the noise as written, {after} times with "
        f"the {answer}."
    )


def leftover_words(left: Mapping[str, Any] | None, verdict: str) -> str:
    """What the answer does not explain, where it is largest."""
    if not left:
        return ""
    amount = (
        f"{told(left['rms'], left['unit'])} at {left['channel']}, "
        f"{percent(left['share_of_motion'])} of its range, are not explained."
    )
    if left["ordinary"]:
        return f"{amount} That is no more than ordinary imperfections of a good rig leave."
    if not left["material"]:
        return f"{amount} That is too little to matter."
    return f"{amount} {'No effect exceeds it clearly.' if verdict == 'none' else 'That matters.'}"


def legend_words(first: Trace) -> str:
    """What the short names of the curves mean."""
    words = ["As written: predicted by the rig file as written."]
    if first.improved is not None:
        words.append(
            f"{short_name(first.improved_name).capitalize()}: by the {first.improved_name}."
        )
    if first.closest is not None:
        words.append(f"Closest: by the effects that come closest ({spoken(first.closest_name)}).")
    return " ".join(words)


def error_words(first: Trace, channels: Mapping[str, Any]) -> str:
    """The errors of a channel that its figure shows."""
    size = channels.get(first.channel)
    if not size:
        return f"The nearer to zero, the better {first.channel} is predicted."
    unit = str(size["unit"])
    after = f", {told(size['after'], unit)} with the {first.improved_name}"
    return (
        f"RMS error of {first.channel}: {told(size['before'], unit)} as written"
        f"{after if first.improved is not None else ''}."
    )
