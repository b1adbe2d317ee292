"""Constants that decide which experiment is proposed; they do not change a verdict."""

from __future__ import annotations

from dataclasses import dataclass

from pam_gap.rules.rule import proposal_rule


@dataclass(frozen=True, slots=True)
class ExperimentRules:
    """How the excitations of the menu are compared."""

    # fmt: off
    correlation: float = proposal_rule(50.0, unit="-",
        decides="Factor by which correlated residuals carry less information than white ones.",
        trades="Larger: hypotheses can imitate each other more freely, and separations look "
               "smaller.")
    most_survivors: int = proposal_rule(4, unit="hypotheses",
        decides="Largest number of hypotheses that are compared.",
        trades="More: the computation takes longer.")
    closest: int = proposal_rule(3, unit="hypotheses",
        decides="Number of hypotheses that the experiment after a verdict of `unknown` should "
                "separate.",
        trades="More: the computation takes longer, and the closest hypotheses are separated "
               "less well.")
    decisive: float = proposal_rule(0.5, unit="level",
        decides="Expected difference of the levels that counts as separating two hypotheses.",
        trades="Larger: more proposals carry the warning that the experiment may be too weak.")
    # fmt: on
