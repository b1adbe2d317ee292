"""Constants with which effects are followed over many recordings; they do not change a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from pam_gap.rules.rule import NUMERICAL, proposal_rule

_by_hand = partial(proposal_rule, origin="Hand-set with the first simulated fleet. No derivation.")
_FALSE_CHANGES = (
    "Chosen so that fewer than 5 % of series without any change show one, also with outliers and "
    "with intervals three times too short."
)


@dataclass(frozen=True, slots=True)
class FleetRules:
    """Which effects are followed, and what counts as a change of their values."""

    # fmt: off
    several: int = _by_hand(2, unit="recordings",
        decides="Number of recordings in which an effect must be found to be followed.",
        trades="Larger: an effect that is seldom found is not followed. Smaller: confusions with "
               "other effects are followed.")
    several_share: float = _by_hand(0.15, unit="of the recordings",
        decides="Share of the diagnosed recordings in which an effect must be found, too.",
        trades="As for `several`.")
    most_followed: int = _by_hand(3, unit="effects",
        decides="Largest number of effects of one joint that are fitted together.",
        trades="More: the values of effects that look alike become uncertain.")
    needed: float = _by_hand(0.25, unit="of what all explain",
        decides="Share of what all followed effects explain together that an effect must explain "
                "to be kept.",
        trades="Larger: weak effects are not followed. Smaller: two effects that look alike "
               "share the values of one.")
    where_it_helps: float = _by_hand(0.25, unit="of the recordings",
        decides="Share of the recordings on which `needed` is judged: those where the effect "
                "helps most.",
        trades="Larger: an effect that was repaired early is not followed. Smaller: single "
               "recordings decide.")
    chosen_on: int = _by_hand(24, unit="recordings",
        decides="Largest number of recordings, evenly spaced in time, on which the effects are "
                "chosen.",
        trades="More: the choice takes longer.")
    freedom: float = proposal_rule(4.0, unit="-",
        decides="Degrees of freedom of the Student distribution of the errors.",
        trades="Larger: a single outlier can look like a change. Smaller: changes are found "
               "later.",
        origin="Usual value (K. Lange, R. Little and J. Taylor, 1989).")
    fewest: int = proposal_rule(6, unit="values",
        decides="Number of values below which no change is sought.",
        trades="Larger: changes are found later. Smaller: a few values decide.",
        origin="Two segments of `segment` values.")
    segment: int = _by_hand(3, unit="values",
        decides="Smallest number of values before and after a change.",
        trades="Larger: changes are found later. Smaller: outliers look like changes.")
    most_changes: int = _by_hand(4, unit="changes",
        decides="Largest number of changes that are sought in one series.",
        trades="More: long series are described better, and take longer.")
    penalty: float = proposal_rule(4.0, unit="log(values)",
        decides="Cost of a change whose date is searched.",
        trades="Larger: changes are found later. Smaller: more false changes.",
        origin=_FALSE_CHANGES)
    penalty_from_start: float = proposal_rule(3.0, unit="log(values)",
        decides="Cost of a slope that begins with the series.",
        trades="As for `penalty`.",
        origin=_FALSE_CHANGES)
    neighbours: int = _by_hand(5, unit="values",
        decides="Number of neighbouring values whose median is the size of the effect at a time.",
        trades="Larger: the spread follows a repair late.")
    least_spread: float = _by_hand(0.1, unit="of the spread",
        decides="Share of the common spread that remains where the effect is 0.",
        trades="Larger: changes near 0 are found later. Smaller: noise near 0 looks like a "
               "change.")
    rounds: int = proposal_rule(12, unit="-",
        decides="Number of reweighted least squares fits of one model.",
        trades="Fewer: the fit has not converged. More: the computation takes longer.",
        origin=NUMERICAL)
    # fmt: on
