"""Constants that decide which experiment is proposed; they change no verdict."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import PROPOSAL, rule


@dataclass(frozen=True, slots=True)
class ExperimentRules:
    """How the excitations of the menu are compared."""

    correlation: float = rule(
        50.0,
        unit="-",
        decides="How much less information correlated residuals hold than white noise would.",
        trades="Larger: survivors can imitate each other more freely, separations look smaller.",
        acts=PROPOSAL,
    )
    most_survivors: int = rule(
        4,
        unit="hypotheses",
        decides="Hypotheses that are compared at most.",
        trades="More: time.",
        acts=PROPOSAL,
    )
    closest: int = rule(
        3,
        unit="hypotheses",
        decides="Hypotheses that the experiment after `unknown` is to separate.",
        trades="More: time, and a weaker experiment for the closest ones.",
        acts=PROPOSAL,
    )
    decisive: float = rule(
        0.5,
        unit="level",
        decides="Expected difference of the levels that counts as separating two hypotheses.",
        trades="Larger: more experiments come with the warning that they may be too weak.",
        acts=PROPOSAL,
    )
